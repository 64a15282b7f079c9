"""One thruster at a time, driven while a key is held: frames to the microcontroller, armed for that long alone."""

from __future__ import annotations

import asyncio
import contextlib
import random
from collections.abc import AsyncIterator

from paani.clock import stopwatch_ms
from paani.config import ThrustersConfig
from paani.errors import UserError
from paani.messages import McuState, McuVerdict
from paani.microcontroller.caller import CallError, McuCaller
from paani.microcontroller.numbering import FrameNumbers
from paani.microcontroller.payloads import THRUST, EscSettings, McuStatus, ThrustCall

FRAME_S = 0.05
LEASE_MS = 200  # four frames
SILENT_S = 3.0  # a microcontroller that has not answered for so long ends the calibration
HOLD_WORDS = ("emergency stop", "radio receiver", "battery low", "over-current")


class Bench:
    """The microcontroller with both speed controllers as they are: no trim, no deadband, neither side reversed."""

    def __init__(self, settings: ThrustersConfig) -> None:
        self._settings = settings
        self._numbers = FrameNumbers(random.SystemRandom())
        self._configured_session = 0
        self._answered_ms = stopwatch_ms()
        self.caller = McuCaller(settings.line, THRUST)
        self.caller.on_status = self._observe

    @property
    def span_us(self) -> int:
        return self._settings.span_us

    async def send(self, left_us: float, right_us: float, *, is_armed: bool) -> McuStatus | None:
        """One frame, with pulses this far from neutral; None where it was not taken. Raises UserError on silence."""
        try:
            status = await self._call(left_us, right_us, is_armed)
        except CallError as error:
            if stopwatch_ms() - self._answered_ms > SILENT_S * 1e3:
                raise UserError(f"thrusters.line {self.caller.problem or error}") from error
            return None
        self._answered_ms = stopwatch_ms()
        if status.verdict is McuVerdict.ACCEPTED:
            return status
        if status.verdict is McuVerdict.FOREIGN_SESSION:
            raise UserError(f"thrusters.line {self._settings.line}: another program drives the thrusters, stop it")
        self._configured_session = 0
        return None

    def _observe(self, status: McuStatus) -> None:
        self._numbers.observe(status)

    async def _call(self, left_us: float, right_us: float, is_armed: bool) -> McuStatus:
        session, span_us = self._numbers.session, self._settings.span_us
        if self._configured_session != session:
            status = await self.caller.call("paani_esc", self._esc(session).encode())
            if status.verdict is not McuVerdict.ACCEPTED:
                return status
            self._configured_session = session
        session, seq = self._numbers.advance()
        frame = ThrustCall(
            armed=is_armed, session=session, seq=seq, lease_ms=LEASE_MS, left=left_us / span_us,
            right=right_us / span_us,
        )  # fmt: skip
        return await self.caller.call("paani_thrust", frame.encode())

    def _esc(self, session: int) -> EscSettings:
        settings = self._settings
        return EscSettings(
            session=session, neutral_us=settings.neutral_us, span_us=settings.span_us, slew_per_s=settings.slew_per_s,
            min_battery_v=settings.min_battery_v, max_current_a=settings.max_current_a,
        )  # fmt: skip


def is_driven(status: McuStatus | None) -> bool:
    """Whether the pulses of the frame are those at the speed controllers."""
    return status is not None and status.state is McuState.FRESH and status.holds == 0


def holds_text(status: McuStatus | None) -> str:
    """What keeps the thrusters still on the microcontroller; empty while nothing does."""
    holds = status.holds if status is not None else 0
    return ", ".join(word for place, word in enumerate(HOLD_WORDS) if holds >> place & 1)


@contextlib.asynccontextmanager
async def connected(settings: ThrustersConfig) -> AsyncIterator[Bench]:
    """The bench while its line is kept open; the last frame is zero and disarmed."""
    bench = Bench(settings)
    task = asyncio.create_task(bench.caller.run())
    try:
        yield bench
    finally:
        with contextlib.suppress(UserError):
            await bench.send(0.0, 0.0, is_armed=False)
        task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await task
