"""What a receiver lets in. Everything else is counted by cause and dropped.

Epochs are milliseconds of the producer's clock when it began. One further ahead of the receiver's clock than two clocks
may differ would outrank every honest epoch to come, so it is refused like a stamp of the future. One that was accepted
before the receiver's clock was set back is forgotten, so that a producer that begins again is heard.

Stamps of a boat's other machine are judged by the clock that made them, and `source_us` comes out by this machine's.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, TypeVar

import msgspec

from paani import messages as m
from paani.keys import NOBODY, Topic

T = TypeVar("T", bound=m.Message)
ShiftUs = Callable[[m.Message, int], int]
MAX_MESSAGE_BYTES = 1 << 20  # of a message without pictures; a step of a deciding process with its state is the largest


def same_clock(message: m.Message, now_us: int) -> int:
    """The difference of two clocks that are one."""
    return 0


def since_sent(message: m.Message, now_us: int) -> int:
    """The difference if the message had been sent just now."""
    return now_us - message.sent_us


class Admission(Generic[T]):
    """Judges the messages of one topic, in the order they arrive. What nobody may write is never let in."""

    def __init__(
        self,
        topic: Topic[T],
        domain: int,
        max_future_s: float,
        shift_us: ShiftUs = same_clock,
        *,
        as_sent: bool = False,
    ) -> None:
        """shift_us: by how much this machine's clock is ahead of the one that stamped a message that came now [us].

        as_sent: messages come out with the stamps of their producer all the same.
        """
        self._topic, self._shift_us, self._as_sent = topic, shift_us, as_sent
        self._decoder = msgspec.json.Decoder(topic.type)
        self._domain = domain
        self._max_future_us = round(max_future_s * 1e6)
        self._epoch = 0
        self._seq = -1

    def judge(self, data: bytes, now_us: int) -> tuple[T | None, str]:
        """The message and an empty cause, or None and why it was refused.

        A restarted producer has a higher epoch and starts its own sequence. An older epoch comes back only where the
        newer one has not begun by the producer's clock, which for `since_sent` the message itself tells.
        """
        if len(data) > MAX_MESSAGE_BYTES:
            return None, "oversized"
        try:
            message = self._decoder.decode(data)
        except msgspec.ValidationError as error:
            return None, "wrong_type" if " got " in str(error) or "missing" in str(error) else "out_of_range"
        except RecursionError:
            return None, "undecodable"
        except (msgspec.DecodeError, UnicodeDecodeError):
            return None, "non_finite" if b"NaN" in data or b"Infinity" in data else "undecodable"
        if message.domain != self._domain:
            return None, "wrong_domain"
        if message.producer != self._topic.producer or message.producer == NOBODY:
            return None, "wrong_producer"
        if message.topic != self._topic.name:
            return None, "wrong_topic"
        shift_us = self._shift_us(message, now_us)
        latest_us = now_us + self._max_future_us - shift_us  # by the clock of the producer
        epoch = max(message.epoch, message.frame_epoch) if isinstance(message, m.PictureHeader) else message.epoch
        if max(message.source_us, message.sent_us, epoch * 1000) > latest_us:
            return None, "future"
        if self._epoch * 1000 > latest_us:
            self._epoch, self._seq = 0, -1
        if message.epoch < self._epoch:
            return None, "old_epoch"
        if message.epoch == self._epoch and message.seq <= self._seq:
            return None, "duplicate" if message.seq == self._seq else "replayed"
        self._epoch, self._seq = message.epoch, message.seq
        if shift_us and not self._as_sent:
            message = msgspec.structs.replace(message, source_us=max(0, message.source_us + shift_us))
        return message, ""
