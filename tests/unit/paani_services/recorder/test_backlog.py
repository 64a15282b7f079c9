"""What waits to be written is bounded, and what became of every message is known."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from paani import keys
from paani import messages as m
from paani.logs.writer import Head
from paani_services.recorder.backlog import Backlog, QueuedMessage
from paani_services.recorder.counts import MessageCounts, file_counts


def heard(number: int, *, picture: bool, size: int = 10) -> QueuedMessage:
    topic = keys.PICTURE if picture else keys.IMU
    return QueuedMessage(topic, number, Head(source_us=0, seq=number), b"x" * size, b"")


def test_the_oldest_pictures_are_dropped_first() -> None:
    """P3: a bounded queue."""
    backlog = Backlog(max_messages=4, max_bytes=1000)
    evicted = []
    for number, picture in enumerate((False, True, True, False, False, False, False)):
        evicted += backlog.put(heard(number, picture=picture))
    assert [one.log_us for one in evicted] == [1, 2, 0]
    assert [one.log_us for one in backlog.drain()] == [3, 4, 5, 6]
    assert len(backlog) == 0


def test_bytes_are_bounded_too() -> None:
    backlog = Backlog(max_messages=100, max_bytes=1000)
    assert backlog.put(heard(0, picture=True, size=600)) == []
    assert [one.log_us for one in backlog.put(heard(1, picture=False, size=600))] == [0]
    assert [one.log_us for one in backlog.put(heard(2, picture=False, size=5000))] == [1, 2]
    assert backlog.drain() == []


@given(
    st.lists(st.tuples(st.booleans(), st.integers(0, 300)), max_size=60),
    st.integers(1, 20),
    st.integers(1, 2000),
)
def test_every_message_is_drained_or_returned_as_dropped(
    messages: list[tuple[bool, int]], count: int, size: int
) -> None:
    """Property: what comes in is drained in order or handed back, and the bounds hold all the time."""
    backlog = Backlog(count, size)
    evicted = []
    for number, (picture, length) in enumerate(messages):
        evicted += backlog.put(heard(number, picture=picture, size=length))
        assert len(backlog) <= count
    kept = [one.log_us for one in backlog.drain()]
    assert kept == sorted(kept)
    assert sorted(kept + [one.log_us for one in evicted]) == list(range(len(messages)))


def test_gaps_in_sequence_numbers_count_as_missing() -> None:
    counts = MessageCounts()
    for epoch, seq in ((1, 7), (1, 8), (1, 11), (1, 11), (1, 9), (2, 0), (3, 2), (1, 50), (3, 3)):
        counts.count_received("a", Head(source_us=0, seq=seq, epoch=epoch))
    [topic] = counts.topics()
    assert topic.missing == 2 + 2, "9 and 10 of epoch 1, 0 and 1 of epoch 3; nothing before the first"


@given(st.lists(st.sampled_from(("lost", "dropped", "written")), min_size=1, max_size=200), st.data())
def test_produced_is_written_plus_dropped_plus_missing(fates: list[str], data: st.DataObject) -> None:
    """P3, property: every number that a producer gave out between the first and last heard is accounted for."""
    counts = MessageCounts()
    restarts = data.draw(st.sets(st.integers(1, len(fates))))
    epoch, seq, first, produced, produced_when_heard = 1, -1, True, 0, 0
    for number, fate in enumerate(fates):
        if number in restarts:
            epoch, seq = epoch + 1, -1
            produced = produced_when_heard  # numbers after the last of an epoch that was heard are known to nobody
        seq += 1
        produced += not first or fate != "lost"
        if fate == "lost":
            continue
        first = False
        produced_when_heard = produced
        counts.count_received("a", Head(source_us=0, seq=seq, epoch=epoch))
        if fate == "dropped":
            counts.count_dropped("a")
        else:
            counts.count_written(["a"])
    for topic in counts.topics():
        assert topic.written + topic.dropped + topic.missing == produced_when_heard


def test_a_file_has_its_own_counts() -> None:
    before = (m.RecordedTopic(topic="a", written=10, dropped=1, missing=2, unreadable=1),)
    now = (
        m.RecordedTopic(topic="a", written=15, dropped=3, missing=2, unreadable=1),
        m.RecordedTopic(topic="b", written=4),
    )
    assert file_counts(now, before) == {
        "a": "written=5 dropped=2 missing=0 unreadable=0",
        "b": "written=4 dropped=0 missing=0 unreadable=0",
    }


def test_a_message_without_a_header_is_counted() -> None:
    counts = MessageCounts()
    counts.count_received("a", None)
    counts.count_received("a", Head(source_us=0, seq=5))
    [topic] = counts.topics()
    assert (topic.unreadable, topic.missing) == (1, 0)
