"""Fills a message's header as the bus does, and shows every message to whoever records the drive."""

from __future__ import annotations

from typing import Protocol, TypeVar

import msgspec

from paani import messages as m
from paani.keys import Topic

T = TypeVar("T", bound=m.Message)
START_US = 1_800_000_000_000_000  # the first stamp of every drive, so that equal drives are equal to the byte


class Tap(Protocol):
    """Sees every message as sent; `data` are a picture's bytes."""

    def __call__(self, topic: Topic[m.Message], message: m.Message, now_us: int, data: bytes = b"") -> None: ...


class Outbox:
    """Numbers the messages of one drive. `tap` None: nobody watches."""

    def __init__(self, domain: int, tap: Tap | None = None) -> None:
        self.epoch = START_US // 1000
        self.tap = tap
        self._domain = domain
        self._seq: dict[str, int] = {}

    def put(self, topic: Topic[T], message: T, now_us: int, data: bytes = b"") -> T:
        """The message as sent at `now_us`."""
        seq = self._seq[topic.name] = self._seq.get(topic.name, -1) + 1
        sent = msgspec.structs.replace(
            message, seq=seq, epoch=self.epoch, domain=self._domain, producer=topic.producer, sent_us=now_us
        )
        if self.tap is not None:
            self.tap(topic, sent, now_us, data)  # type: ignore[arg-type]  # a topic of one message type is one of messages
        return sent
