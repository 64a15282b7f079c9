"""Bounded inboxes between Zenoh's thread and the event loop: newest wins, nothing ever blocks."""

from __future__ import annotations

import asyncio
import collections
import contextlib
import math
from typing import Generic, TypeVar

from paani.clock import Clock, steady_beside
from paani.decider import Input

V = TypeVar("V")


class Inbox(Generic[V]):
    """Counts and a wake-up that is scheduled at most once."""

    def __init__(self, clock: Clock) -> None:
        self._clock, self._steady = clock, steady_beside(clock)
        self._loop = asyncio.get_running_loop()
        self._event = asyncio.Event()
        self._armed = False
        self.received = 0
        self.superseded = 0
        self.received_us = self._steady_us = 0

    def receipt_age_s(self) -> float:
        """Seconds since the last message came, however the clock was set since; infinite before the first."""
        return (self._steady.now_us() - self._steady_us) * 1e-6 if self.received else math.inf

    def _note_receipt(self) -> None:
        self.received += 1
        self.received_us, self._steady_us = self._clock.now_us(), self._steady.now_us()

    def _wake(self) -> None:
        if not self._armed:
            self._armed = True
            with contextlib.suppress(RuntimeError):  # the loop has closed: nobody is left to wake
                self._loop.call_soon_threadsafe(self._woken)

    def _woken(self) -> None:
        self._armed = False
        self._event.set()


class Latest(Inbox[V]):
    """Depth one: `value` is the newest message, or None before the first."""

    def __init__(self, clock: Clock) -> None:
        super().__init__(clock)
        self.value: V | None = None
        self.newest = Input()
        self._taken = True

    def offer(self, value: V) -> None:
        """Called on Zenoh's thread."""
        self.superseded += not self._taken
        self.value, self._taken = value, False
        self._note_receipt()  # last, so that nobody on another thread takes the one before for new
        self.newest = Input(value, self.received_us)
        self._wake()

    def fresh(self, limit_s: float) -> V | None:
        """The newest message where it came within this time, else None."""
        return self.value if self.receipt_age_s() <= limit_s else None

    async def next(self) -> V:
        """The newest message that `next` has not returned yet; waits for one."""
        while self._taken or self.value is None:
            self._event.clear()
            if self._taken:
                await self._event.wait()
        self._taken = True
        return self.value


class Queue(Inbox[V]):
    """A short queue that drops its oldest."""

    def __init__(self, clock: Clock, depth: int) -> None:
        super().__init__(clock)
        self._items: collections.deque[V] = collections.deque(maxlen=depth)

    def offer(self, value: V) -> None:
        """Called on Zenoh's thread."""
        self.superseded += len(self._items) == self._items.maxlen
        self._items.append(value)
        self._note_receipt()
        self._wake()

    def drain(self) -> list[V]:
        """Everything that waits, oldest first."""
        items = []
        with contextlib.suppress(IndexError):
            while True:
                items.append(self._items.popleft())
        return items

    async def get(self) -> V:
        """The oldest that waits; waits for one."""
        while not self._items:
            self._event.clear()
            if not self._items:
                await self._event.wait()
        return self._items.popleft()
