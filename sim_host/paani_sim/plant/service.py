"""Plant process: thrust, or an emulated microcontroller's pulses, in; time, sensors and truth out, at real time.

While a scenario's link is lost, nothing of the board reaches the thrust adapter, and the board gets no time.
"""

import asyncio
import functools

from paani import keys
from paani import messages as m
from paani.bus import Bus
from paani.clock import Clock, MonotonicClock
from paani.config import Config
from paani.errors import UserError
from paani.thrust_adapter import AppliedThrust, InForce, ThrustAdapter, applied_message
from paani_sim.plant.plant import Plant
from paani_sim.plant.pwm import PulseInput
from paani_sim.plant.telemetry import Measurements, report_every
from paani_sim.worlds import Fault
from paani_sim.worlds.faults import is_linked
from paani_sim.worlds.load import configured_scenario

MAX_BEHIND_S = 0.25  # further behind than this, simulated time slips instead of being caught up


async def run(bus: Bus, clock: Clock, config: Config) -> None:
    """Step the plant in real time: by the thrust adapter, or in the graph `hil` by an emulator's pulses alone."""
    if config.bus.graph is keys.Graph.HIL:
        await run_by_pulses(bus, clock, config)
    else:
        await run_by_thrust(bus, clock, config)


async def run_by_pulses(bus: Bus, clock: Clock, config: Config) -> None:
    """The plant behind an emulated microcontroller: it hears no thrust, and measures."""
    if not config.plant.pwm_line:
        raise UserError("plant.pwm_line: not set (the emulator's bench port, such as socket://127.0.0.1:5002)")
    monotonic = MonotonicClock()
    plant = Plant.from_scenario(configured_scenario(config.world), config.plant)
    pulses = PulseInput(config, monotonic)
    measurements = Measurements(bus, config.plant)
    step_us, due_us = round(config.plant.step_s * 1e6), monotonic.now_us()
    async with asyncio.TaskGroup() as group:
        group.create_task(pulses.run())
        with bus.alive():
            while True:
                now_us = monotonic.now_us()
                due_us = _without_backlog(bus, due_us, now_us)
                while due_us <= now_us:
                    plant.step(*pulses.forces_n(now_us))
                    measurements.publish(plant, clock.now_us() - (now_us - due_us))
                    due_us += step_us
                bus.note("" if pulses.is_live(now_us) else f"no pulses from {config.plant.pwm_line}")
                await asyncio.sleep(max(0, due_us - monotonic.now_us()) * 1e-6)


async def run_by_thrust(bus: Bus, clock: Clock, config: Config) -> None:
    """Watchdogs run on the monotonic clock that `SimTime` hands out."""
    monotonic = MonotonicClock()
    scenario = configured_scenario(config.world)
    plant, adapter = Plant.from_scenario(scenario, config.plant), ThrustAdapter(config.adapter, config.bus.domain)
    link = _BoardLink(plant, scenario.faults)
    thrust, arming = bus.latest(keys.THRUST), bus.latest(keys.ARMING)
    for service in config.adapter.require_pulses:
        bus.on(keys.pulse(service), functools.partial(_receive_pulse, adapter, service, monotonic, link))
    measurements, report = Measurements(bus, config.plant), _AppliedThrust(bus, monotonic, config, link)
    step_us = round(config.plant.step_s * 1e6)
    handled: tuple[m.Thrust | None, m.Arming | None] = (None, None)
    with bus.alive():
        due_us = monotonic.now_us()
        while True:
            now_us = monotonic.now_us()
            handled = _pass_to_adapter(bus, adapter, link, handled, (thrust.value, arming.value), now_us)
            due_us = _without_backlog(bus, due_us, now_us)
            while due_us <= now_us:
                applied = adapter.decide(now_us)
                plant.step(applied.left_n, applied.right_n)
                source_us = clock.now_us() - (now_us - due_us)
                measurements.publish(plant, source_us)
                report.publish(plant, adapter, applied, source_us)
                due_us += step_us
            await asyncio.sleep(max(0, due_us - monotonic.now_us()) * 1e-6)


def _without_backlog(bus: Bus, due_us: int, now_us: int) -> int:
    """When the next step is due: time too far behind slips, and is counted."""
    if now_us - due_us <= MAX_BEHIND_S * 1e6:
        return due_us
    bus.count_drop("sim_time_slipped_ms", (now_us - due_us) // 1000)
    return now_us


class _BoardLink:
    """The link between board and host, which the scenario may interrupt."""

    def __init__(self, plant: Plant, faults: tuple[Fault, ...]) -> None:
        self._plant, self._faults = plant, faults

    def is_up(self) -> bool:
        """Whether messages pass at the present simulated time."""
        return is_linked(self._faults, self._plant.sim_us * 1e-6)


def _pass_to_adapter(
    bus: Bus,
    adapter: ThrustAdapter,
    link: _BoardLink,
    handled: tuple[m.Thrust | None, m.Arming | None],
    newest: tuple[m.Thrust | None, m.Arming | None],
    now_us: int,
) -> tuple[m.Thrust | None, m.Arming | None]:
    """Pass new messages to the adapter; thrust that came over a lost link is dropped."""
    thrust, arming = newest
    if arming is not None and arming is not handled[1]:
        adapter.receive_arming(arming, now_us)
    if thrust is not None and thrust is not handled[0] and link.is_up():
        cause = adapter.offer(thrust, now_us)
        if cause is not m.ZeroCause.NONE:
            bus.count_drop(f"thrust_{cause.value}")
    return newest


def _receive_pulse(adapter: ThrustAdapter, service: str, monotonic: Clock, link: _BoardLink, _: m.Pulse) -> None:
    if service not in keys.BOARD_SERVICES or link.is_up():
        adapter.receive_pulse(service, monotonic.now_us())


class _AppliedThrust:
    """Publishes the board's clock and what is applied, at their rate."""

    def __init__(self, bus: Bus, monotonic: Clock, config: Config, link: _BoardLink) -> None:
        self._monotonic, self._link = monotonic, link
        self._time, self._applied = bus.publisher(keys.SIM_TIME), bus.publisher(keys.THRUST_APPLIED)
        self._every = report_every(config.plant)
        self._last_cause = m.ZeroCause.NO_COMMAND
        self._in_force = InForce()

    def publish(self, plant: Plant, adapter: ThrustAdapter, applied: AppliedThrust, source_us: int) -> None:
        """`source_us` dates the step that was just made. The clock is for the board alone."""
        is_due = plant.steps % self._every == 0
        if is_due and self._link.is_up():
            stamp_us = self._monotonic.now_us()
            self._time.put(m.SimTime(source_us=source_us, sim_us=plant.sim_us, stamp_us=stamp_us))
        self._in_force.advance(applied, adapter.command, source_us)
        if is_due or applied.zero_cause is not self._last_cause:
            self._applied.put(applied_message(adapter, applied, source_us, self._in_force))
            self._last_cause = applied.zero_cause
