"""Message counts of each topic: received, written, dropped here, or missing before they arrived. Pure."""

from __future__ import annotations

import threading
from collections.abc import Iterable

import msgspec

from paani import messages as m
from paani.logs.writer import Head


class TopicCounts(msgspec.Struct):
    """One topic. Each sequence number of its producer is received or missing; each message received is written,
    dropped or still queued.
    """

    received: int = 0
    written: int = 0
    dropped: int = 0
    missing: int = 0
    unreadable: int = 0
    epoch: int = -1
    seq: int = -1


class MessageCounts:
    """Counts of all topics. Safe to call from the event loop and the writer's thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._topics: dict[str, TopicCounts] = {}

    def count_received(self, topic: str, head: Head | None) -> None:
        """Count one message. Numbers skipped by its sequence are missing; a new epoch starts at zero."""
        with self._lock:
            counts = self._of(topic)
            counts.received += 1
            if head is None:
                counts.unreadable += 1
                return
            if counts.epoch >= 0:
                before = counts.seq if head.epoch == counts.epoch else -1
                if head.epoch >= counts.epoch and head.seq > before + 1:
                    counts.missing += head.seq - before - 1
            counts.epoch, counts.seq = max((counts.epoch, counts.seq), (head.epoch, head.seq))

    def count_dropped(self, topic: str, n: int = 1) -> None:
        with self._lock:
            self._of(topic).dropped += n

    def count_written(self, topics: Iterable[str]) -> None:
        with self._lock:
            for topic in topics:
                self._of(topic).written += 1

    def topics(self) -> tuple[m.RecordedTopic, ...]:
        """The counts now, by name of the topic."""
        with self._lock:
            return tuple(
                m.RecordedTopic(
                    topic=name, written=t.written, dropped=t.dropped, missing=t.missing, unreadable=t.unreadable
                )
                for name, t in sorted(self._topics.items())
            )

    def _of(self, topic: str) -> TopicCounts:
        return self._topics.setdefault(topic, TopicCounts())


def file_counts(now: Iterable[m.RecordedTopic], before: Iterable[m.RecordedTopic]) -> dict[str, str]:
    """Metadata of a file, one line per topic: the counts since those taken before."""
    old = {topic.topic: topic for topic in before}
    lines = {}
    for topic in now:
        was = old.get(topic.topic, m.RecordedTopic(topic=topic.topic))
        lines[topic.topic] = (
            f"written={topic.written - was.written} dropped={topic.dropped - was.dropped}"
            f" missing={topic.missing - was.missing} unreadable={topic.unreadable - was.unreadable}"
        )
    return lines
