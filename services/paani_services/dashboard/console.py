"""Speaks the operator's word on the bus and keeps the STOP latch on disk."""

from __future__ import annotations

import asyncio
import logging
from pathlib import Path

from paani import keys
from paani import messages as m
from paani.bus import Publisher
from paani.clock import Clock
from paani.runtime import write_private
from paani_services.dashboard import operator as op

LOG = logging.getLogger(__name__)
LATCH_FILE = "stop-latch"


class Console:
    """STOP is spoken before anything else is tried; arming waits until the disk has let the latch go."""

    def __init__(self, publisher: Publisher[m.Arming], folder: Path, clock: Clock) -> None:
        self._publisher, self._path, self._clock = publisher, folder / LATCH_FILE, clock
        self._writing = asyncio.Lock()
        self._changed = asyncio.Event()
        self.state = op.Operator(stopped=True)

    async def restore(self, *, arm_at_start: bool) -> None:
        """Take up the latch of an earlier run. An unreadable latch is a STOP."""
        latch = await asyncio.to_thread(read_latch, self._path)
        self.state = op.at_start(latch, arm_at_start=arm_at_start)

    async def stop(self) -> bool:
        """Latch a STOP; true when it will also outlive this process."""
        self.state = op.stop(self.state, self._clock.now_us())
        self.speak()
        self._changed.set()
        async with self._writing:
            return await self._write()

    async def arm(self) -> bool:
        """Arm; false when a STOP came meanwhile or the latch could not be released on disk."""
        stops = self.state.stops
        async with self._writing:
            if not await asyncio.to_thread(write_latch, self._path, op.CLEAR):
                return False
            if self.state.stops != stops:
                await self._write()
                return False
            self.state = op.arm(self.state)
        self.speak()
        self._changed.set()
        return True

    def speak(self) -> None:
        """Say the present word now."""
        self._publisher.put(op.arming(self.state, self._clock.now_us()))

    async def speak_always(self) -> None:
        """Repeat the word at the rate of its topic; the last word is that nobody arms any more."""
        try:
            while True:
                self.speak()
                await asyncio.sleep(1.0 / keys.ARMING.rate_hz)
        finally:
            self._publisher.put(m.Arming(source_us=self._clock.now_us(), armed=False, stopped=self.state.stopped))

    def hear_applied(self, applied: m.ThrustApplied) -> None:
        """The plant's word, for a STOP that waits to be confirmed."""
        before, self.state = self.state, op.hear_applied(self.state, applied, self._clock.now_us())
        if self.state != before:
            self._changed.set()

    async def changed(self, timeout_s: float) -> None:
        """Return when the state changed, or after `timeout_s`."""
        try:
            async with asyncio.timeout(timeout_s):
                await self._changed.wait()
        except TimeoutError:
            return
        self._changed.clear()

    async def _write(self) -> bool:
        return await asyncio.to_thread(write_latch, self._path, op.latch_text(self.state))


def read_latch(path: Path) -> str | None:
    """Text of the latch file; None where there is none; an unreadable one reads as empty."""
    try:
        return path.read_text(encoding="utf-8")
    except FileNotFoundError:
        return None
    except (OSError, UnicodeDecodeError) as error:
        LOG.warning("%s: %s: taken as a STOP", path, error)
        return ""


def write_latch(path: Path, text: str) -> bool:
    """Replace the latch file whole; false when the disk refuses."""
    try:
        write_private(path, text)
    except OSError as error:
        LOG.error("%s: %s", path, error)  # noqa: TRY400  # a full disk is not a bug
        return False
    return True
