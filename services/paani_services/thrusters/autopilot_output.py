"""The output to an autopilot: one line, opened again by itself, for the decision of the thrust adapter."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable

from paani import messages as m
from paani.clock import stopwatch_ms
from paani.config import AutopilotConfig
from paani.extras import require_modules
from paani.serial_port import Port, PortError, open_port
from paani.thrust_adapter import AppliedThrust, ThrustAdapter
from paani_services.thrusters.autopilot import Autopilot
from paani_services.thrusters.output import zero

LOG = logging.getLogger(__name__)
RETRY_S = 0.5
MAX_TEXT = 400  # of a message's text


def operators_word(adapter: ThrustAdapter, decided: AppliedThrust) -> bool | None:
    """Whether the operator has armed; None where his word has never come, or is too old to hold."""
    if not adapter.has_heard_operator or decided.zero_cause is m.ZeroCause.ARMING_LOST:
        return None
    return adapter.is_armed


class AutopilotOutput:
    """What stands behind the thrust adapter where an autopilot drives the motors."""

    def __init__(self, settings: AutopilotConfig) -> None:
        require_modules("thrusters.autopilot", "pymavlink")
        from paani_services.thrusters.autopilot_frames import AutopilotFrames  # noqa: PLC0415  # needs an extra

        self._settings = settings
        self._autopilot = Autopilot(settings.own_system)
        self._frames = AutopilotFrames(settings.system, settings.own_system)
        self._port: Port | None = None
        self._port_problem = "not opened yet"
        self._connections = self._sent = 0
        self._told = ""

    async def run(self) -> None:
        """Keep the line open until cancelled."""
        while True:
            try:
                port = await open_port(self._settings.line)
            except PortError as error:
                self._port_problem = str(error)
            else:
                await self._listen(port)
            await asyncio.sleep(RETRY_S)

    async def _listen(self, port: Port) -> None:
        self._port = port
        self._connections += 1
        try:
            while True:
                self._frames.decode(await port.read(), self._autopilot, stopwatch_ms())
        except PortError as error:
            self._port_problem = str(error)
        finally:
            self._port = None
            self._autopilot.lose_line()
            await port.close()

    async def send(self, adapter: ThrustAdapter, decide: Callable[[], AppliedThrust]) -> None:
        """What is due now: the decision, unless something forbids it."""
        decided = decide()
        orders = self._autopilot.advance(decided, operators_word(adapter, decided), stopwatch_ms())
        self._tell()
        port = self._port
        if port is None:
            return
        try:
            await port.write(b"".join(map(self._frames.encode, orders)))
        except PortError as error:
            LOG.debug("%s", error)
            return
        self._sent += len(orders)

    def applied(self, decided: AppliedThrust, now_ms: float) -> AppliedThrust:
        """The decision, or zero with the cause that the autopilot gives."""
        cause = m.ZeroCause.LINE_LOST if self._port is None else self._autopilot.zero_cause(now_ms)
        return decided if cause is m.ZeroCause.NONE else zero(decided, cause)

    def state(self, cause: m.ZeroCause, now_us: int, now_ms: float) -> m.ThrustersState:
        """The line, what was sent, and the problem."""
        mixed = self._autopilot.mixed
        problem = self._port_problem if self._port is None else self._autopilot.problem(now_ms)
        line = self._settings.line
        return m.ThrustersState(
            source_us=now_us,
            line=line[:MAX_TEXT],
            connected=self._port is not None,
            zero_cause=cause,
            problem=(f"{line}: {problem}" if problem and line not in problem else problem)[:MAX_TEXT],
            armed=self._autopilot.is_driving,
            left=mixed.left,
            right=mixed.right,
            sent=self._sent,
            connections=self._connections,
            answer_age_ms=self._autopilot.silence_ms(now_ms),
        )

    def note(self, state: m.ThrustersState) -> str:
        """One line for the health report."""
        return state.problem or ("autopilot armed, MANUAL" if state.armed else "autopilot heard, not armed")

    def _tell(self) -> None:
        problem = self._autopilot.problem(stopwatch_ms())
        if problem != self._told and problem:
            LOG.warning("%s: %s", self._settings.line, problem)
        self._told = problem
