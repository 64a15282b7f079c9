"""The output to the microcontroller that drives the speed controllers: one call at a time, each answered."""

from __future__ import annotations

import logging
import random
from collections.abc import Callable

from paani import messages as m
from paani.clock import stopwatch_ms
from paani.config import ThrustersConfig
from paani.microcontroller.caller import CallError, McuCaller
from paani.microcontroller.numbering import FrameNumbers
from paani.microcontroller.payloads import THRUST, McuStatus
from paani.thrust_adapter import AppliedThrust, ThrustAdapter
from paani_services.thrusters import output
from paani_services.thrusters.state import Sent, note_of, thrusters_state

LOG = logging.getLogger(__name__)


class EscOutput:
    """What stands behind the thrust adapter where our own microcontroller drives the motors."""

    def __init__(self, settings: ThrustersConfig, count_drop: Callable[[str], None]) -> None:
        self._settings, self._count_drop = settings, count_drop
        self._numbers = FrameNumbers(random.SystemRandom())
        self._configured_session = 0
        self._tracker = output.OutputTracker(settings.lease_ms)
        self._sent = Sent()
        self._caller = McuCaller(settings.line, THRUST)
        self._caller.on_status = self._observe
        self.run = self._caller.run

    async def send(self, adapter: ThrustAdapter, decide: Callable[[], AppliedThrust]) -> None:
        """One call: settings first, for each session; without a word of the operator a question alone.

        The microcontroller takes a disarmed frame as the operator's leave to arm again, so nothing but his word is one.
        One that has not answered for a lease is told to lie still: nobody here would know what it does.
        """
        if not self._caller.is_connected:
            return
        try:
            await self._call(adapter, decide)
        except CallError as error:
            LOG.debug("%s", error)

    def applied(self, decided: AppliedThrust, now_ms: float) -> AppliedThrust:
        """The decision, unless the microcontroller withholds it or still runs the last one."""
        return self._tracker.applied(decided, self._cause(now_ms), now_ms)

    def state(self, cause: m.ZeroCause, now_us: int, now_ms: float) -> m.ThrustersState:
        """The line, what was sent, and what the microcontroller says."""
        return thrusters_state(self._caller, self._sent, cause, now_us, now_ms)

    def note(self, state: m.ThrustersState) -> str:
        """One line for the health report."""
        return note_of(state)

    async def _call(self, adapter: ThrustAdapter, decide: Callable[[], AppliedThrust]) -> None:
        if not adapter.has_heard_operator:
            await self._caller.call("paani_status")
            return
        session = self._numbers.session
        if self._configured_session != session:
            status = await self._caller.call("paani_esc", output.esc_settings(self._settings, session).encode())
            if status.verdict is not m.McuVerdict.ACCEPTED:
                self._count_drop(f"refused_{status.verdict}")
                return
            self._configured_session = session
        decided = decide()
        if self._cause(stopwatch_ms()) is m.ZeroCause.LINE_LOST:
            decided = output.zero(decided, m.ZeroCause.LINE_LOST)
        call = output.thrust_call(decided, adapter.is_armed, self._numbers.advance(), self._settings.lease_ms)
        self._sent = Sent(call.armed, call.left, call.right, call.session)
        self._tracker.send(decided, stopwatch_ms())
        try:
            status = await self._caller.call("paani_thrust", call.encode())
        except CallError:
            self._tracker.lose(stopwatch_ms())
            raise
        if status.verdict is m.McuVerdict.ACCEPTED:
            self._tracker.accept(stopwatch_ms())
            return
        self._tracker.refuse()
        self._count_drop(f"refused_{status.verdict}")
        if status.verdict is m.McuVerdict.NOT_CONFIGURED:
            self._configured_session = 0

    def _cause(self, now_ms: float) -> m.ZeroCause:
        """Why the microcontroller gives no thrust, as far as is known now."""
        caller = self._caller
        return output.find_output_cause(caller.status, now_ms - caller.status_ms, self._settings.lease_ms)

    def _observe(self, status: McuStatus) -> None:
        if self._numbers.observe(status):
            LOG.warning("%s: the microcontroller restarted (%s)", self._settings.line, status.reset_cause)
            self._count_drop("microcontroller_restarted")
