"""Thrusters process: the thrust adapter's decision to the microcontroller, its clock and what is applied to the bus."""

from __future__ import annotations

import asyncio
import contextlib
import functools
import logging
import random

from paani import keys
from paani import messages as m
from paani.bus import Bus
from paani.clock import Clock, MonotonicClock, stopwatch_ms
from paani.config import Config
from paani.errors import UserError
from paani.microcontroller.caller import CallError, McuCaller
from paani.microcontroller.numbering import FrameNumbers
from paani.microcontroller.payloads import THRUST, McuStatus
from paani.thrust_adapter import AppliedThrust, ThrustAdapter, applied_message
from paani_services.thrusters import output
from paani_services.thrusters.state import Sent, note_of, thrusters_state

LOG = logging.getLogger(__name__)
STATE_EVERY = 4  # of the reports of what is applied: five a second


async def run(bus: Bus, clock: Clock, config: Config) -> None:
    """Drive the thrusters until told to stop. Raises UserError without a line."""
    if not config.thrusters.line:
        raise UserError("thrusters.line: not set (where the microcontroller is, such as serial:/dev/ttyACM1@115200)")
    thrusters = Thrusters(bus, clock, config)
    with bus.alive():
        async with asyncio.TaskGroup() as group:
            for work in (thrusters.caller.run, thrusters.hear_thrust, thrusters.hear_arming, thrusters.drive):
                group.create_task(work())
            group.create_task(thrusters.report())


class Thrusters:
    """The thrust adapter, and behind it a microcontroller instead of a simulated plant."""

    def __init__(self, bus: Bus, clock: Clock, config: Config) -> None:
        self._bus, self._clock, self._settings = bus, clock, config.thrusters
        self._monotonic = MonotonicClock()
        self._adapter = ThrustAdapter(config.adapter, config.bus.domain)
        self._thrust, self._arming = bus.latest(keys.THRUST), bus.latest(keys.ARMING)
        for service in config.adapter.require_pulses:
            bus.on(keys.pulse(service), functools.partial(self._receive_pulse, service))
        self._time, self._applied = bus.publisher(keys.SIM_TIME), bus.publisher(keys.THRUST_APPLIED)
        self._state = bus.publisher(keys.THRUSTERS_STATE)
        self._numbers = FrameNumbers(random.SystemRandom())
        self._configured_session = 0
        self._output = output.OutputTracker(config.thrusters.lease_ms)
        self._sent = Sent()
        self._due, self._changed = asyncio.Event(), asyncio.Event()
        self.caller = McuCaller(config.thrusters.line, THRUST)
        self.caller.on_status = self._observe

    async def hear_thrust(self) -> None:
        """Offer each order to the adapter when it comes; what is refused is counted by cause."""
        while True:
            cause = self._adapter.offer(await self._thrust.next(), self._monotonic.now_us())
            if cause is not m.ZeroCause.NONE:
                self._bus.count_drop(f"thrust_{cause.value}")
            self._due.set()

    async def hear_arming(self) -> None:
        """Pass on the operator's word; a change of it goes out at once."""
        while True:
            was_armed = self._adapter.is_armed
            self._adapter.receive_arming(await self._arming.next(), self._monotonic.now_us())
            if self._adapter.is_armed is not was_armed:
                self._due.set()

    async def drive(self) -> None:
        """One frame a period, and at once where there is a new order or another word of the operator."""
        while True:
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(1.0 / self._settings.rate_hz):
                    await self._due.wait()
            self._due.clear()
            if self.caller.is_connected:
                try:
                    await self._send()
                except CallError as error:
                    LOG.debug("%s", error)
            self._changed.set()

    async def report(self) -> None:
        """The clock that orders echo, what is applied, and the state; at once where the cause of a zero changes."""
        schedule = output.ReportSchedule(1000.0 / keys.SIM_TIME.rate_hz, self._clock.now_us(), stopwatch_ms())
        while True:
            now_us, now_ms = self._clock.now_us(), stopwatch_ms()
            applied = self._applied_now(now_ms)
            is_due, has_changed = schedule.advance(applied.zero_cause, self._adapter.command, now_us, now_ms)
            if is_due:
                stamp_us = self._monotonic.now_us()
                self._time.put(m.SimTime(source_us=now_us, sim_us=stamp_us, stamp_us=stamp_us))
            if is_due or has_changed:
                self._applied.put(applied_message(self._adapter, applied, now_us, schedule.since_us))
            if has_changed or (is_due and schedule.count % STATE_EVERY == 0):
                state = thrusters_state(self.caller, self._sent, applied.zero_cause, now_us, now_ms)
                self._state.put(state)
                self._bus.note(note_of(state))
            self._changed.clear()
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(schedule.wait_s(stopwatch_ms())):
                    await self._changed.wait()

    async def _send(self) -> None:
        """One call: settings first, for each session; without a word of the operator a question alone.

        The microcontroller takes a disarmed frame as the operator's leave to arm again, so nothing but his word is one.
        """
        if not self._adapter.has_heard_operator:
            await self.caller.call("paani_status")
            return
        session = self._numbers.session
        if self._configured_session != session:
            status = await self.caller.call("paani_esc", output.esc_settings(self._settings, session).encode())
            if status.verdict is not m.McuVerdict.ACCEPTED:
                self._bus.count_drop(f"refused_{status.verdict}")
                return
            self._configured_session = session
        decided = self._decide()
        call = output.thrust_call(decided, self._adapter.is_armed, self._numbers.advance(), self._settings.lease_ms)
        self._sent = Sent(call.armed, call.left, call.right, call.session)
        status = await self.caller.call("paani_thrust", call.encode())
        if status.verdict is m.McuVerdict.ACCEPTED:
            self._output.accept(decided, stopwatch_ms())
            return
        self._bus.count_drop(f"refused_{status.verdict}")
        if status.verdict is m.McuVerdict.NOT_CONFIGURED:
            self._configured_session = 0

    def _decide(self) -> AppliedThrust:
        return self._adapter.decide(self._monotonic.now_us())

    def _applied_now(self, now_ms: float) -> AppliedThrust:
        cause = output.find_output_cause(self.caller.status, now_ms - self.caller.status_ms, self._settings.lease_ms)
        return self._output.applied(self._decide(), cause, now_ms)

    def _receive_pulse(self, service: str, _: m.Pulse) -> None:
        self._adapter.receive_pulse(service, self._monotonic.now_us())

    def _observe(self, status: McuStatus) -> None:
        if self._numbers.observe(status):
            LOG.warning("%s: the microcontroller restarted (%s)", self._settings.line, status.reset_cause)
            self._bus.count_drop("microcontroller_restarted")
