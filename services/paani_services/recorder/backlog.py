"""Queue between the bus and the writer, bounded by messages and bytes; when it is full, pictures are dropped first."""

from __future__ import annotations

import collections
import threading
from typing import Any, NamedTuple

from paani import keys
from paani.logs.writer import Head


class QueuedMessage(NamedTuple):
    """One message as received: its topic, the time of receipt [us], its header where it has one, and its bytes."""

    topic: keys.Topic[Any]
    log_us: int
    head: Head | None
    data: bytes
    attachment: bytes

    @property
    def size_bytes(self) -> int:
        return len(self.data) + len(self.attachment)


class Backlog:
    """Filled by the event loop, drained by the writer's thread."""

    def __init__(self, max_messages: int, max_bytes: int) -> None:
        self._max_messages, self._max_bytes = max_messages, max_bytes
        self._lock = threading.Lock()
        self._pictures: collections.deque[QueuedMessage] = collections.deque()
        self._others: collections.deque[QueuedMessage] = collections.deque()
        self._size_bytes = 0

    def __len__(self) -> int:
        return len(self._pictures) + len(self._others)

    def put(self, message: QueuedMessage) -> list[QueuedMessage]:
        """Queue one message; returns those dropped for it: the oldest pictures first, then the oldest of the rest."""
        with self._lock:
            queue = self._pictures if message.topic.stance is keys.Stance.PICTURE else self._others
            queue.append(message)
            self._size_bytes += message.size_bytes
            evicted = []
            while len(self) > self._max_messages or self._size_bytes > self._max_bytes:
                evicted.append((self._pictures or self._others).popleft())
                self._size_bytes -= evicted[-1].size_bytes
            return evicted

    def drain(self) -> list[QueuedMessage]:
        """Take all messages that wait, in order of receipt."""
        with self._lock:
            messages = [*self._pictures, *self._others]
            self._pictures.clear()
            self._others.clear()
            self._size_bytes = 0
        messages.sort(key=_log_us)
        return messages


def _log_us(message: QueuedMessage) -> int:
    return message.log_us
