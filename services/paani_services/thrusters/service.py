"""Thrusters process: the thrust adapter's decision to the motors, its clock and what is applied to the bus."""

from __future__ import annotations

import asyncio
import contextlib
import functools
from collections.abc import Callable
from typing import Protocol

from paani import keys
from paani import messages as m
from paani.bus import Bus
from paani.clock import Clock, MonotonicClock, stopwatch_ms
from paani.config import Config
from paani.errors import UserError
from paani.thrust_adapter import AppliedThrust, InForce, ThrustAdapter, applied_message
from paani_services.thrusters.autopilot_output import AutopilotOutput
from paani_services.thrusters.esc_output import EscOutput
from paani_services.thrusters.output import ReportSchedule

STATE_EVERY = 4  # of the reports of what is applied: five a second


async def run(bus: Bus, clock: Clock, config: Config) -> None:
    """Drive the thrusters until told to stop. Raises UserError without a line."""
    settings = config.thrusters
    if not settings.is_connected:
        raise UserError("thrusters.line: not set (where the microcontroller is, such as serial:/dev/ttyACM1@115200)")
    output = AutopilotOutput(settings.autopilot) if settings.autopilot.line else EscOutput(settings, bus.count_drop)
    thrusters = Thrusters(bus, clock, config, output)
    with bus.alive():
        async with asyncio.TaskGroup() as group:
            for work in (output.run, thrusters.hear_thrust, thrusters.hear_arming, thrusters.drive, thrusters.report):
                group.create_task(work())


class Output(Protocol):
    """What stands behind the thrust adapter: a way to the motors that is kept open, and what is known of its end."""

    async def run(self) -> None:
        """Keep the line open until cancelled."""

    async def send(self, adapter: ThrustAdapter, decide: Callable[[], AppliedThrust]) -> None:
        """Send the decision of the moment it goes out, and whatever else is due."""

    def applied(self, decided: AppliedThrust, now_ms: float) -> AppliedThrust:
        """What is applied, as far as it is known."""

    def state(self, cause: m.ZeroCause, now_us: int, now_ms: float) -> m.ThrustersState:
        """For the bus."""

    def note(self, state: m.ThrustersState) -> str:
        """One line for the health report."""


class Thrusters:
    """The thrust adapter, and behind it a way to motors instead of a simulated plant."""

    def __init__(self, bus: Bus, clock: Clock, config: Config, output: Output) -> None:
        self._bus, self._clock, self._settings = bus, clock, config.thrusters
        self._monotonic = MonotonicClock()
        self._adapter = ThrustAdapter(config.adapter, config.bus.domain)
        self._thrust, self._arming = bus.latest(keys.THRUST), bus.latest(keys.ARMING)
        for service in config.adapter.require_pulses:
            bus.on(keys.pulse(service), functools.partial(self._receive_pulse, service))
        self._time, self._applied = bus.publisher(keys.SIM_TIME), bus.publisher(keys.THRUST_APPLIED)
        self._state = bus.publisher(keys.THRUSTERS_STATE)
        self._output = output
        self._due, self._changed = asyncio.Event(), asyncio.Event()

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
            arming = await self._arming.next()
            age_us = max(0, self._clock.now_us() - arming.source_us)  # the operator may be on the other machine
            self._adapter.receive_arming(arming, self._monotonic.now_us() - age_us)
            if self._adapter.is_armed is not was_armed:
                self._due.set()

    async def drive(self) -> None:
        """One frame a period, and at once where there is a new order or another word of the operator."""
        while True:
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(1.0 / self._settings.rate_hz):
                    await self._due.wait()
            self._due.clear()
            await self._output.send(self._adapter, self._decide)
            self._changed.set()

    async def report(self) -> None:
        """The clock that orders echo, what is applied, and the state; at once where the cause of a zero changes."""
        schedule, in_force = ReportSchedule(1000.0 / keys.SIM_TIME.rate_hz, stopwatch_ms()), InForce()
        while True:
            now_us, now_ms = self._clock.now_us(), stopwatch_ms()
            applied = self._output.applied(self._decide(), now_ms)
            in_force.advance(applied, self._adapter.command, now_us)
            is_due, has_changed = schedule.advance(applied.zero_cause, now_ms)
            if is_due:
                stamp_us = self._monotonic.now_us()
                self._time.put(m.SimTime(source_us=now_us, sim_us=stamp_us, stamp_us=stamp_us))
            if is_due or has_changed:
                self._applied.put(applied_message(self._adapter, applied, now_us, in_force))
            if has_changed or (is_due and schedule.count % STATE_EVERY == 0):
                state = self._output.state(applied.zero_cause, now_us, now_ms)
                self._state.put(state)
                self._bus.note(self._output.note(state))
            self._changed.clear()
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(schedule.wait_s(stopwatch_ms())):
                    await self._changed.wait()

    def _decide(self) -> AppliedThrust:
        return self._adapter.decide(self._monotonic.now_us())

    def _receive_pulse(self, service: str, _: m.Pulse) -> None:
        self._adapter.receive_pulse(service, self._monotonic.now_us())
