"""Plant process: thrust in; time, sensors and truth out, at real time."""

import asyncio
import functools

from paani import keys
from paani import messages as m
from paani.bus import Bus
from paani.clock import Clock, MonotonicClock
from paani.config import Config
from paani_sim.plant.adapter import Applied, ThrustAdapter
from paani_sim.plant.plant import Plant
from paani_sim.worlds import load_world

MAX_BEHIND_S = 0.25  # further behind than this, simulated time slips instead of being caught up


async def run(bus: Bus, clock: Clock, config: Config) -> None:
    """Step the plant in real time. Watchdogs run on the monotonic clock that `SimTime` hands out."""
    monotonic = MonotonicClock()
    plant = Plant(load_world(config.world.name), config.plant, config.world.seed)
    adapter = ThrustAdapter(config.plant.adapter, config.bus.domain)
    thrust, arming = bus.latest(keys.THRUST), bus.latest(keys.ARMING)
    for service in config.plant.adapter.require_pulses:
        bus.on(keys.pulse(service), functools.partial(_pulse, adapter, service, monotonic))
    instruments = _Instruments(bus, monotonic, config)
    step_us = round(config.plant.step_s * 1e6)
    seen: tuple[m.Thrust | None, m.Arming | None] = (None, None)
    with bus.alive():
        due_us = monotonic.now_us()
        while True:
            now_us = monotonic.now_us()
            seen = _hear(bus, adapter, seen, (thrust.value, arming.value), now_us)
            if now_us - due_us > MAX_BEHIND_S * 1e6:
                bus.count_drop("sim_time_slipped_ms", (now_us - due_us) // 1000)
                due_us = now_us
            while due_us <= now_us:
                applied = adapter.decide(now_us)
                plant.step(applied.left_n, applied.right_n)
                instruments.publish(plant, adapter, applied, clock.now_us() - (now_us - due_us))
                due_us += step_us
            await asyncio.sleep(max(0, due_us - monotonic.now_us()) * 1e-6)


def _hear(
    bus: Bus,
    adapter: ThrustAdapter,
    seen: tuple[m.Thrust | None, m.Arming | None],
    newest: tuple[m.Thrust | None, m.Arming | None],
    now_us: int,
) -> tuple[m.Thrust | None, m.Arming | None]:
    """Give the adapter what is new since the last time."""
    thrust, arming = newest
    if arming is not None and arming is not seen[1]:
        adapter.hear_arming(arming, now_us)
    if thrust is not None and thrust is not seen[0]:
        cause = adapter.offer(thrust, now_us)
        if cause is not m.ZeroCause.NONE:
            bus.count_drop(f"thrust_{cause.value}")
    return newest


def _pulse(adapter: ThrustAdapter, service: str, monotonic: Clock, _: m.Pulse) -> None:
    adapter.hear_pulse(service, monotonic.now_us())


class _Instruments:
    """Publishes each measurement when its step comes."""

    def __init__(self, bus: Bus, monotonic: Clock, config: Config) -> None:
        self._monotonic = monotonic
        self._time = bus.publisher(keys.SIM_TIME)
        self._gps, self._imu = bus.publisher(keys.GPS), bus.publisher(keys.IMU)
        self._applied, self._pose = bus.publisher(keys.THRUST_APPLIED), bus.publisher(keys.TRUE_POSE)
        rate_hz = 1.0 / config.plant.step_s
        self._gps_every = max(1, round(rate_hz / config.plant.sensors.gps_rate_hz))
        self._imu_every = max(1, round(rate_hz / config.plant.sensors.imu_rate_hz))
        self._every = max(1, round(rate_hz / config.plant.publish_rate_hz))

    def publish(self, plant: Plant, adapter: ThrustAdapter, applied: Applied, source_us: int) -> None:
        """`source_us` dates the step that was just made."""
        if plant.steps % self._imu_every == 0:
            self._imu.put(imu_message(plant, source_us))
        if plant.steps % self._gps_every == 0:
            self._gps.put(gps_message(plant, source_us))
        if plant.steps % self._every == 0:
            stamp_us = self._monotonic.now_us()
            self._time.put(m.SimTime(source_us=source_us, sim_us=plant.sim_us, stamp_us=stamp_us))
            self._pose.put(pose_message(plant, source_us))
            self._applied.put(applied_message(adapter, applied, source_us))


def gps_message(plant: Plant, source_us: int) -> m.GpsFix:
    """Read the GPS."""
    return m.GpsFix(source_us=source_us, **plant.read_gps()._asdict())


def imu_message(plant: Plant, source_us: int) -> m.ImuSample:
    """Read the IMU."""
    reading = plant.read_imu()
    gyro, accel = reading.rates_radps, reading.specific_force_mps2
    return m.ImuSample(
        source_us=source_us,
        gyro_x_radps=gyro[0],
        gyro_y_radps=gyro[1],
        gyro_z_radps=gyro[2],
        accel_x_mps2=accel[0],
        accel_y_mps2=accel[1],
        accel_z_mps2=accel[2],
        orientation_available=True,
        roll_rad=reading.roll_rad,
        pitch_rad=reading.pitch_rad,
        yaw_rad=reading.yaw_rad,
    )


def pose_message(plant: Plant, source_us: int) -> m.TruePose:
    """Simulator truth."""
    (x_m, y_m), angles, (surge_mps, sway_mps, yaw_rate) = plant.position_m, plant.attitude, plant.velocity
    return m.TruePose(
        source_us=source_us,
        sim_us=plant.sim_us,
        x_m=x_m,
        y_m=y_m,
        z_m=plant.z_m,
        roll_rad=angles.roll_rad,
        pitch_rad=angles.pitch_rad,
        yaw_rad=angles.yaw_rad,
        surge_mps=surge_mps,
        sway_mps=sway_mps,
        yaw_rate_radps=yaw_rate,
        distance_m=plant.distance_m,
        collisions=plant.collisions,
        in_contact=plant.in_contact,
    )


def applied_message(adapter: ThrustAdapter, applied: Applied, source_us: int) -> m.ThrustApplied:
    """What the last gate does now, and the command behind it."""
    command = adapter.command
    return m.ThrustApplied(
        source_us=source_us,
        **applied._asdict(),
        rejected=adapter.rejected,
        command_seq=command.seq if command else 0,
        command_sent_us=command.sent_us if command else 0,
        command_source_us=command.source_us if command else 0,
    )
