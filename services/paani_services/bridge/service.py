"""Bridge process: the newest advisory to the microcontroller, and its answers to the bus."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import random

from paani import keys
from paani import messages as m
from paani.bus import Bus, Latest
from paani.clock import Clock, stopwatch_ms
from paani.config import BridgeConfig, Config
from paani.errors import UserError
from paani.microcontroller.caller import CallError, McuCaller
from paani.microcontroller.numbering import FrameNumbers
from paani.microcontroller.payloads import INDICATION, McuStatus
from paani_services.bridge.state import bridge_state
from paani_services.bridge.symbols import Symbols, guide_of, symbols_of

LOG = logging.getLogger(__name__)
METHOD = "paani_guide"  # the one method that this process calls


async def run(bus: Bus, clock: Clock, config: Config) -> None:
    """Show the advice until told to stop. Raises UserError without a line."""
    if not config.bridge.line:
        raise UserError("bridge.line: not set (where the microcontroller is, such as serial:/dev/ttyACM0@115200)")
    bridge = Bridge(bus, clock, config.bridge)
    with bus.alive():
        async with asyncio.TaskGroup() as group:
            group.create_task(bridge.caller.run(), name="line")
            group.create_task(bridge.show_advice(), name="frames")


class Bridge:
    """Sends frames at a steady rate, and at once where the advice changes; publishes what came of each."""

    def __init__(self, bus: Bus, clock: Clock, settings: BridgeConfig) -> None:
        self._bus, self._clock, self._settings = bus, clock, settings
        self._advisory: Latest[m.Advisory] = bus.latest(keys.ADVISORY)
        self._state = bus.publisher(keys.BRIDGE_STATE)
        self._numbers = FrameNumbers(random.SystemRandom())
        self.caller = McuCaller(settings.line, INDICATION)
        self.caller.on_status = self._observe

    async def show_advice(self) -> None:
        """One frame a period, one at a time."""
        period_ms = 1000.0 / self._settings.rate_hz
        while True:
            started_ms = stopwatch_ms()
            symbols = self._symbols()
            if self.caller.is_connected:
                await self._send(symbols)
            self._publish(symbols)
            await self._wait_for_change(symbols, started_ms + period_ms)

    def _symbols(self) -> Symbols:
        newest = self._advisory.newest
        advisory = newest.message if isinstance(newest.message, m.Advisory) else None
        return symbols_of(advisory, newest.received_us, self._clock.now_us(), self._settings.lease_ms)

    async def _send(self, symbols: Symbols) -> None:
        session, seq = self._numbers.advance()
        try:
            status = await self.caller.call(METHOD, guide_of(symbols, session, seq, self._settings.lease_ms).encode())
        except CallError as error:
            LOG.debug("frame %d: %s", seq, error)
            return
        if status.verdict not in {m.McuVerdict.ACCEPTED, m.McuVerdict.NONE}:
            self._bus.count_drop(f"refused_{status.verdict}")

    async def _wait_for_change(self, symbols: Symbols, due_ms: float) -> None:
        """Until the next frame is due, or the advice is another."""
        while (left_s := (due_ms - stopwatch_ms()) / 1000) > 0:
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(left_s):
                    await self._advisory.next()
            if not self._symbols().is_shown_like(symbols):
                return

    def _publish(self, symbols: Symbols) -> None:
        state = bridge_state(self.caller, symbols, self._numbers.session, self._clock.now_us(), stopwatch_ms())
        self._state.put(state)
        self._bus.note(state.problem or f"{state.mcu}, shows {state.display}, {state.round_trip_p50_ms:.1f} ms")

    def _observe(self, status: McuStatus) -> None:
        if self._numbers.observe(status):
            LOG.warning("%s: the microcontroller restarted (%s)", self._settings.line, status.reset_cause)
            self._bus.count_drop("microcontroller_restarted")
