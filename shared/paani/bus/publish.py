"""Publishers fill the header and never block, never raise on a dead link."""

from __future__ import annotations

import asyncio
import contextlib
from typing import Generic, TypeVar

import msgspec
import zenoh

from paani import messages as m
from paani.clock import Clock
from paani.keys import Stance, Topic

T = TypeVar("T", bound=m.Message)

PRIORITY = {
    Stance.COMMAND: zenoh.Priority.REAL_TIME,
    Stance.STATE: zenoh.Priority.DATA,
    Stance.EVENT: zenoh.Priority.DATA_HIGH,
    Stance.PICTURE: zenoh.Priority.DATA_LOW,
}
EPOCH_AHEAD_MS = 100  # a source that begins again several times within a millisecond runs ahead by so little
LONG_POLL_S = 2.0
WATCHED_US = 5_000_000  # whoever pulls asks again within this time


class Numbering:
    """Epoch and sequence of one publisher. An epoch never lies ahead of the publisher's clock for long.

    Where the clock was set back, a new and lower epoch begins: receivers take no epoch of the future.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self.epoch = clock.now_us() // 1000
        self.seq = -1

    def new_epoch(self) -> None:
        self.epoch = max(self.epoch + 1, self._clock.now_us() // 1000)
        self.seq = -1

    def advance(self) -> None:
        """Number the next message."""
        now_ms = self._clock.now_us() // 1000
        if self.epoch > now_ms + EPOCH_AHEAD_MS:
            self.epoch, self.seq = now_ms, -1
        self.seq += 1


class Publisher(Generic[T]):
    """Publishes messages of one topic."""

    def __init__(
        self, session: zenoh.Session, topic: Topic[T], key: str, domain: int, clock: Clock, steady: Clock | None
    ) -> None:
        """steady: the clock of `steady_us`; None on a boat of one machine."""
        self._topic, self._domain, self._clock, self._steady = topic, domain, clock, steady
        self._numbering = Numbering(clock)
        self._encoder = msgspec.json.Encoder()
        self._publisher = session.declare_publisher(
            key,
            encoding=zenoh.Encoding(topic.media_type),
            priority=PRIORITY[topic.stance],
            congestion_control=zenoh.CongestionControl.DROP,
            express=topic.stance is Stance.COMMAND,
        )

    def put(self, message: T) -> T:
        """Publish and return the message as sent."""
        stamped = self._stamp(message)
        self._publisher.put(self._encoder.encode(stamped))
        return stamped

    def forward(self, data: bytes) -> None:
        """Publish an encoded message as it is. For replays: they have a router of their own."""
        self._publisher.put(data)

    def new_epoch(self) -> None:
        """The source began again: receivers forget what came before."""
        self._numbering.new_epoch()

    def _stamp(self, message: T) -> T:
        self._numbering.advance()
        return self._topic.stamp(
            message,
            domain=self._domain,
            seq=self._numbering.seq,
            epoch=self._numbering.epoch,
            sent_us=self._clock.now_us(),
            steady_us=0 if self._steady is None else self._steady.now_us(),
        )


class PicturePublisher(Publisher[m.PictureHeader]):
    """Pushes pictures on this machine and answers long-poll pulls with the newest."""

    def __init__(
        self,
        session: zenoh.Session,
        topic: Topic[m.PictureHeader],
        key: str,
        domain: int,
        clock: Clock,
        steady: Clock | None,
        *,
        push: bool,
    ) -> None:
        super().__init__(session, topic, key, domain, clock, steady)
        self._push = push
        self._asked_us: int | None = None
        self._newest: tuple[m.PictureHeader, bytes, bytes] | None = None
        self._arrived = asyncio.Event()
        self._loop = asyncio.get_running_loop()
        self._answers: set[asyncio.Task[None]] = set()
        self._key = key
        self._queryable = session.declare_queryable(key, zenoh.handlers.Callback(self._on_query, indirect=False))

    def put_picture(self, header: m.PictureHeader, data: bytes) -> m.PictureHeader:
        """Publish encoded picture bytes; returns the header as sent."""
        stamped = self._stamp(header)
        self.forward_picture(stamped, data)
        return stamped

    def forward_picture(self, header: m.PictureHeader, data: bytes) -> None:
        """Publish encoded picture bytes with the header as it is. For replays: they have a router of their own."""
        attachment = self._encoder.encode(header)
        self._newest = (header, attachment, data)
        if self._push:
            self._publisher.put(data, attachment=attachment, encoding=zenoh.Encoding(header.media_type))
        self._arrived.set()
        self._arrived = asyncio.Event()

    def is_watched(self) -> bool:
        """Does anyone subscribe, or has anyone pulled lately? What nobody watches need not be drawn."""
        asked = self._asked_us is not None and self._clock.now_us() - self._asked_us < WATCHED_US
        return asked or (
            self._push and bool(self._publisher.matching_status.matching)  # type: ignore[attr-defined]  # zenoh's stubs
        )

    def _on_query(self, query: zenoh.Query) -> None:
        self._asked_us = self._clock.now_us()
        with contextlib.suppress(RuntimeError):
            self._loop.call_soon_threadsafe(self._start_answer, query)

    def _start_answer(self, query: zenoh.Query) -> None:
        task = asyncio.ensure_future(self._answer(query))
        self._answers.add(task)
        task.add_done_callback(self._answers.discard)

    async def _answer(self, query: zenoh.Query) -> None:
        with query:
            after = after_of(str(query.parameters))
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(LONG_POLL_S):
                    while not self._is_newer(after):
                        await self._arrived.wait()
            if self._newest is not None and self._is_newer(after):
                header, attachment, data = self._newest
                query.reply(self._key, data, attachment=attachment, encoding=zenoh.Encoding(header.media_type))

    def _is_newer(self, after: tuple[int, int]) -> bool:
        """Whether the newest is another than what was asked to come after: of a lower epoch too, after a set clock."""
        if self._newest is None:
            return False
        header, (epoch, seq) = self._newest[0], after
        return header.epoch != epoch or header.seq > seq


def after_of(parameters: str) -> tuple[int, int]:
    """Epoch and sequence in `after=<epoch>.<seq>`; anything else asks for whatever there is."""
    name, _, value = parameters.partition("=")
    epoch, dot, seq = value.partition(".")
    if name == "after" and dot and epoch.isdecimal() and seq.isdecimal():
        return int(epoch), int(seq)
    return (-1, -1)
