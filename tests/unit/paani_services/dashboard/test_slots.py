"""One slow client loses its own old frames, in order, and nobody else's."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from paani_services.dashboard.slots import Slots


def drain(slots: Slots) -> list[bytes]:
    frames = []
    while (frame := slots.pop()) is not None:
        frames.append(frame)
    return frames


def test_newest_state_wins_and_the_old_one_is_counted() -> None:
    slots = Slots()
    for frame in (b"1", b"2", b"3"):
        slots.put_state("pose", frame)
    assert drain(slots) == [b"3"]
    assert slots.superseded == 2


def test_no_key_starves_another() -> None:
    slots = Slots()
    slots.put_state("slow", b"s")
    sent = []
    for n in range(5):
        slots.put_state("fast", str(n).encode())
        sent.append(slots.pop())
    assert sent[0] == b"s"


def test_events_go_first_in_order_and_the_ring_drops_its_oldest() -> None:
    slots = Slots(event_depth=2)
    slots.put_state("pose", b"p")
    for frame in (b"1", b"2", b"3"):
        slots.put_event(frame)
    assert drain(slots) == [b"2", b"3", b"p"]
    assert slots.dropped_events == 1


@given(st.lists(st.tuples(st.sampled_from("abc"), st.binary(max_size=3)), max_size=60))
def test_memory_is_bounded_by_the_keys(puts: list[tuple[str, bytes]]) -> None:
    slots = Slots()
    for key, frame in puts:
        slots.put_state(key, frame)
    assert len(slots) == len({key for key, _ in puts})
    assert slots.superseded == len(puts) - len(slots)
