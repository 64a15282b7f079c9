"""One slow client loses its own old frames, in order, and nobody else's."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from paani_services.dashboard.client_queue import ClientQueue


def drain(queue: ClientQueue) -> list[bytes]:
    frames = []
    while (frame := queue.pop()) is not None:
        frames.append(frame)
    return frames


def test_newest_state_wins_and_the_old_one_is_counted() -> None:
    queue = ClientQueue()
    for frame in (b"1", b"2", b"3"):
        queue.put_state("pose", frame)
    assert drain(queue) == [b"3"]
    assert queue.superseded == 2


def test_no_key_starves_another() -> None:
    queue = ClientQueue()
    queue.put_state("slow", b"s")
    sent = []
    for n in range(5):
        queue.put_state("fast", str(n).encode())
        sent.append(queue.pop())
    assert sent[0] == b"s"


def test_events_go_first_in_order_and_the_ring_drops_its_oldest() -> None:
    queue = ClientQueue(event_depth=2)
    queue.put_state("pose", b"p")
    for frame in (b"1", b"2", b"3"):
        queue.put_event(frame)
    assert drain(queue) == [b"2", b"3", b"p"]
    assert queue.dropped_events == 1


@given(st.lists(st.tuples(st.sampled_from("abc"), st.binary(max_size=3)), max_size=60))
def test_memory_is_bounded_by_the_keys(puts: list[tuple[str, bytes]]) -> None:
    queue = ClientQueue()
    for key, frame in puts:
        queue.put_state(key, frame)
    assert len(queue) == len({key for key, _ in puts})
    assert queue.superseded == len(puts) - len(queue)
