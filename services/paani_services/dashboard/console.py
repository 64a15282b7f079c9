"""Operator console: publishes the operator's state (armed, or stopped) and keeps the STOP latch on disk."""

from __future__ import annotations

import asyncio
import logging
from pathlib import Path

from paani import keys
from paani import messages as m
from paani.bus import Publisher
from paani.clock import Clock
from paani.runtime import write_private
from paani_services.dashboard import operator_state as op

LOG = logging.getLogger(__name__)
LATCH_FILE = "stop-latch"


class Console:
    """A STOP is published before anything else is tried; arming waits until the latch is released on disk."""

    def __init__(self, publisher: Publisher[m.Arming], folder: Path, clock: Clock) -> None:
        self._publisher, self._path, self._clock = publisher, folder / LATCH_FILE, clock
        self._write_lock = asyncio.Lock()
        self._changed = asyncio.Event()
        self.state = op.OperatorState(stopped=True)

    async def restore(self, *, arm_at_start: bool) -> None:
        """Restore the latch of an earlier run. An unreadable latch counts as a STOP."""
        latch = await asyncio.to_thread(read_latch, self._path)
        self.state = op.initial_state(latch, arm_at_start=arm_at_start)

    async def stop(self) -> bool:
        """Latch a STOP; true when the latch is on disk too, so that it outlives this process."""
        self.state = op.latch_stop(self.state, self._clock.now_us())
        self.publish()
        self._changed.set()
        async with self._write_lock:
            return await self._write()

    async def arm(self) -> bool:
        """Arm; false when a STOP came meanwhile or the latch could not be released on disk."""
        stops = self.state.stops
        async with self._write_lock:
            if not await asyncio.to_thread(write_latch, self._path, op.CLEAR):
                return False
            if self.state.stops != stops:
                await self._write()
                return False
            self.state = op.arm(self.state)
        self.publish()
        self._changed.set()
        return True

    def publish(self) -> None:
        """Publish the present state now."""
        self._publisher.put(op.arming_message(self.state, self._clock.now_us()))

    async def publish_forever(self) -> None:
        """Publish the state at the rate of its topic, and at the end that nobody arms any more."""
        try:
            while True:
                self.publish()
                await asyncio.sleep(1.0 / keys.ARMING.rate_hz)
        finally:
            self._publisher.put(m.Arming(source_us=self._clock.now_us(), armed=False, stopped=self.state.stopped))

    def confirm_stop(self, applied: m.ThrustApplied) -> None:
        """Take what the plant applies as the confirmation of a STOP that waits for one."""
        before, self.state = self.state, op.confirm_stop(self.state, applied, self._clock.now_us())
        if self.state != before:
            self._changed.set()

    async def wait_for_change(self, timeout_s: float) -> None:
        """Return when the state has changed, or after `timeout_s`."""
        try:
            async with asyncio.timeout(timeout_s):
                await self._changed.wait()
        except TimeoutError:
            return
        self._changed.clear()

    async def _write(self) -> bool:
        return await asyncio.to_thread(write_latch, self._path, op.latch_text(self.state))


def read_latch(path: Path) -> str | None:
    """Text of the latch file; None where there is no file, empty where it cannot be read."""
    try:
        return path.read_text(encoding="utf-8")
    except FileNotFoundError:
        return None
    except (OSError, UnicodeDecodeError) as error:
        LOG.warning("%s: %s: the STOP latch cannot be read, so the boat stays stopped", path, error)
        return ""


def write_latch(path: Path, text: str) -> bool:
    """Replace the whole latch file; false when it cannot be written."""
    try:
        write_private(path, text)
    except OSError as error:
        LOG.error("%s: %s", path, error)  # noqa: TRY400  # a full disk is not a bug
        return False
    return True
