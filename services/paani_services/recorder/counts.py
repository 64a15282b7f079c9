"""What became of every message: written, dropped here, or never heard. Pure."""

from __future__ import annotations

import threading
from collections.abc import Iterable

import msgspec

from paani import messages as m
from paani.logs.writer import Head


class Tally(msgspec.Struct):
    """One topic. Of the numbers its producer gave out, each is heard or missing; of those heard, each is
    written, dropped or still waiting.
    """

    heard: int = 0
    written: int = 0
    dropped: int = 0
    missing: int = 0
    unreadable: int = 0
    epoch: int = -1
    seq: int = -1


class Counts:
    """All topics. Safe to call from the event loop and the writer's thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._tallies: dict[str, Tally] = {}

    def heard(self, topic: str, head: Head | None) -> None:
        """A message came. A gap in its producer's numbers is missing; a new epoch counts from zero."""
        with self._lock:
            tally = self._of(topic)
            tally.heard += 1
            if head is None:
                tally.unreadable += 1
                return
            if tally.epoch >= 0:
                before = tally.seq if head.epoch == tally.epoch else -1
                if head.epoch >= tally.epoch and head.seq > before + 1:
                    tally.missing += head.seq - before - 1
            tally.epoch, tally.seq = max((tally.epoch, tally.seq), (head.epoch, head.seq))

    def dropped(self, topic: str, n: int = 1) -> None:
        with self._lock:
            self._of(topic).dropped += n

    def written(self, topics: Iterable[str]) -> None:
        with self._lock:
            for topic in topics:
                self._of(topic).written += 1

    def topics(self) -> tuple[m.RecordedTopic, ...]:
        """As they are now, by name."""
        with self._lock:
            return tuple(
                m.RecordedTopic(
                    topic=name, written=t.written, dropped=t.dropped, missing=t.missing, unreadable=t.unreadable
                )
                for name, t in sorted(self._tallies.items())
            )

    def _of(self, topic: str) -> Tally:
        return self._tallies.setdefault(topic, Tally())


def for_file(now: Iterable[m.RecordedTopic], before: Iterable[m.RecordedTopic]) -> dict[str, str]:
    """What a file's metadata says of each topic: the counts since those taken before."""
    old = {topic.topic: topic for topic in before}
    lines = {}
    for topic in now:
        was = old.get(topic.topic, m.RecordedTopic(topic=topic.topic))
        lines[topic.topic] = (
            f"written={topic.written - was.written} dropped={topic.dropped - was.dropped}"
            f" missing={topic.missing - was.missing} unreadable={topic.unreadable - was.unreadable}"
        )
    return lines
