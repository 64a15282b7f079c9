"""Plant process: thrust in; time, sensors and truth out, at real time.

While a scenario's link is lost, nothing of the board reaches the thrust adapter, and the board gets no time.
"""

import asyncio
import functools

from paani import keys
from paani import messages as m
from paani.bus import Bus
from paani.clock import Clock, MonotonicClock
from paani.config import Config
from paani.thrust_adapter import AppliedThrust, ThrustAdapter, applied_message
from paani_sim.plant.plant import Plant
from paani_sim.plant.telemetry import gps_message, imu_message, pose_message
from paani_sim.worlds import Fault
from paani_sim.worlds.faults import is_linked
from paani_sim.worlds.load import configured_scenario

MAX_BEHIND_S = 0.25  # further behind than this, simulated time slips instead of being caught up


async def run(bus: Bus, clock: Clock, config: Config) -> None:
    """Step the plant in real time. Watchdogs run on the monotonic clock that `SimTime` hands out."""
    monotonic = MonotonicClock()
    scenario = configured_scenario(config.world)
    plant = Plant.from_scenario(scenario, config.plant)
    adapter = ThrustAdapter(config.plant.adapter, config.bus.domain)
    link = _BoardLink(plant, scenario.faults)
    thrust, arming = bus.latest(keys.THRUST), bus.latest(keys.ARMING)
    for service in config.plant.adapter.require_pulses:
        bus.on(keys.pulse(service), functools.partial(_receive_pulse, adapter, service, monotonic, link))
    instruments = _Instruments(bus, monotonic, config, link)
    step_us = round(config.plant.step_s * 1e6)
    handled: tuple[m.Thrust | None, m.Arming | None] = (None, None)
    with bus.alive():
        due_us = monotonic.now_us()
        while True:
            now_us = monotonic.now_us()
            handled = _pass_to_adapter(bus, adapter, link, handled, (thrust.value, arming.value), now_us)
            if now_us - due_us > MAX_BEHIND_S * 1e6:
                bus.count_drop("sim_time_slipped_ms", (now_us - due_us) // 1000)
                due_us = now_us
            while due_us <= now_us:
                applied = adapter.decide(now_us)
                plant.step(applied.left_n, applied.right_n)
                instruments.publish(plant, adapter, applied, clock.now_us() - (now_us - due_us))
                due_us += step_us
            await asyncio.sleep(max(0, due_us - monotonic.now_us()) * 1e-6)


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


class _Instruments:
    """Publishes each measurement at its rate."""

    def __init__(self, bus: Bus, monotonic: Clock, config: Config, link: _BoardLink) -> None:
        self._monotonic, self._link = monotonic, link
        self._time = bus.publisher(keys.SIM_TIME)
        self._gps, self._imu = bus.publisher(keys.GPS), bus.publisher(keys.IMU)
        self._applied, self._pose = bus.publisher(keys.THRUST_APPLIED), bus.publisher(keys.TRUE_POSE)
        rate_hz = 1.0 / config.plant.step_s
        self._gps_every = max(1, round(rate_hz / config.plant.sensors.gps_rate_hz))
        self._imu_every = max(1, round(rate_hz / config.plant.sensors.imu_rate_hz))
        self._report_every = max(1, round(rate_hz / config.plant.publish_rate_hz))
        self._last_cause = m.ZeroCause.NO_COMMAND
        self._in_force: m.Thrust | None = None
        self._since_us = 0

    def publish(self, plant: Plant, adapter: ThrustAdapter, applied: AppliedThrust, source_us: int) -> None:
        """`source_us` dates the step that was just made. The clock is for the board alone."""
        if plant.steps % self._imu_every == 0:
            self._imu.put(imu_message(plant, source_us))
        if plant.steps % self._gps_every == 0:
            self._gps.put(gps_message(plant, source_us))
        if plant.steps % self._report_every == 0:
            if self._link.is_up():
                stamp_us = self._monotonic.now_us()
                self._time.put(m.SimTime(source_us=source_us, sim_us=plant.sim_us, stamp_us=stamp_us))
            self._pose.put(pose_message(plant, source_us))
        in_force = adapter.command if applied.zero_cause is m.ZeroCause.NONE else None
        if in_force is not self._in_force or self._since_us == 0:
            self._in_force, self._since_us = in_force, source_us
        if plant.steps % self._report_every == 0 or applied.zero_cause is not self._last_cause:
            self._applied.put(applied_message(adapter, applied, source_us, self._since_us))
            self._last_cause = applied.zero_cause
