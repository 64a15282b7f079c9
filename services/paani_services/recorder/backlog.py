"""What waits to be written: bounded by count and bytes; pictures go first when it is too much."""

from __future__ import annotations

import collections
import threading
from typing import Any, NamedTuple

from paani import keys
from paani.logs.writer import Head


class Heard(NamedTuple):
    """One message as it came, when [us], and its bytes."""

    topic: keys.Topic[Any]
    log_us: int
    head: Head | None
    data: bytes
    attachment: bytes

    @property
    def size_bytes(self) -> int:
        return len(self.data) + len(self.attachment)


class Backlog:
    """Filled on the event loop, drained for the writer's thread."""

    def __init__(self, max_messages: int, max_bytes: int) -> None:
        self._max_messages, self._max_bytes = max_messages, max_bytes
        self._lock = threading.Lock()
        self._pictures: collections.deque[Heard] = collections.deque()
        self._others: collections.deque[Heard] = collections.deque()
        self._size_bytes = 0

    def __len__(self) -> int:
        return len(self._pictures) + len(self._others)

    def put(self, heard: Heard) -> list[Heard]:
        """Take one; returns those that had to go for it: the oldest pictures, then the oldest of the rest."""
        with self._lock:
            of_its_kind = self._pictures if heard.topic.stance is keys.Stance.PICTURE else self._others
            of_its_kind.append(heard)
            self._size_bytes += heard.size_bytes
            gone = []
            while len(self) > self._max_messages or self._size_bytes > self._max_bytes:
                gone.append((self._pictures or self._others).popleft())
                self._size_bytes -= gone[-1].size_bytes
            return gone

    def drain(self) -> list[Heard]:
        """All that waits, by the time it came."""
        with self._lock:
            heard = [*self._pictures, *self._others]
            self._pictures.clear()
            self._others.clear()
            self._size_bytes = 0
        heard.sort(key=_log_us)
        return heard


def _log_us(heard: Heard) -> int:
    return heard.log_us
