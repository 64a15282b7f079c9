"""Paces a loop over what arrives."""

import asyncio

from paani.clock import Clock


class Pace:
    """Lets one through in a period, on average: what comes late does not make the next late.

    A clock that is set back keeps nobody waiting for longer than a period.
    """

    def __init__(self, clock: Clock, period_us: int) -> None:
        self._clock, self._period_us = clock, period_us
        self._due_us = clock.now_us()

    async def wait(self) -> None:
        """Until the next is due."""
        await asyncio.sleep(min(max(self._due_us - self._clock.now_us(), 0), self._period_us) * 1e-6)

    def took_one(self) -> None:
        """Count one: the next is due a period after this one was, and now where that is past."""
        self._due_us = due_after_us(self._due_us, self._period_us, self._clock.now_us())


def due_after_us(due_us: int, period_us: int, now_us: int) -> int:
    """When the next is due; counted from when the last one was due, not from when it came."""
    return min(max(due_us + period_us, now_us), now_us + period_us)
