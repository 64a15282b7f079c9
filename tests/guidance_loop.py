"""The boat of closed-loop tests: plant, sensors, estimator, navigator, controller and adapter, in lockstep."""

import dataclasses
from collections.abc import Iterator

import msgspec
import numpy as np

from paani.config import Config
from paani.messages import (
    Advisory,
    Arming,
    Direction,
    Evidence,
    GpsFix,
    ImuSample,
    NavCommand,
    Odometry,
    Reason,
    Route,
    SimTime,
    Thrust,
    Waypoint,
)
from paani.missions import mission_of_route
from paani.motion_planning import MotionPlanner
from paani.thrust_adapter import AppliedThrust, ThrustAdapter
from paani_services.controller.control import ControllerInputs, ControllerState, compute_thrust
from paani_services.localization.choice import create_estimator
from paani_services.navigator.interlocks import NavigatorInputs
from paani_services.navigator.mapping.occupancy_grid import UNCALIBRATED_CAMERA
from paani_services.navigator.navigate import NavigatorState, navigate
from paani_sim.plant.plant import Plant
from paani_sim.plant.telemetry import gps_message, imu_message
from paani_sim.worlds import World, load_world

START_US = 1_000_000
DOMAIN = 43


class Lockstep:
    """The guidance chain on one simulated clock: 100 Hz plant, 20 Hz estimator, 10 Hz guidance."""

    def __init__(self, world: World, config: Config, seed: int = 1) -> None:
        self.world, self.config = world, config
        self.plant = Plant(world, config.plant, seed)
        origin_deg = (world.origin_lat_deg, world.origin_lon_deg)
        self.estimator = create_estimator(msgspec.structs.replace(config.localization, origin_lat_lon_deg=origin_deg))
        self.route = Route(
            source_us=0,
            name=world.name,
            waypoints=tuple(Waypoint(x_m=x, y_m=y) for x, y in world.route_m.tolist()),
        )
        self.mission = mission_of_route(self.route)
        self.nav, self.ctl = NavigatorState(), ControllerState()
        self.adapter = ThrustAdapter(config.plant.adapter, DOMAIN)
        self.direction = Direction.STRAIGHT
        self.advisory: Advisory | None = None  # takes the place of `direction`
        self.heading_rad: float | None = None  # takes the place of the navigator's
        self.is_ordered_to_stand = False
        self.armed, self.camera = True, UNCALIBRATED_CAMERA
        self.planner: MotionPlanner | None = None  # takes the place of the navigator's
        self.evidence: Evidence | None = None
        self.command: NavCommand | None = None
        self.thrust: Thrust | None = None
        self.odometry: Odometry | None = None
        self.applied: AppliedThrust = self.adapter.decide(START_US)
        self.seq = 0

    @property
    def now_us(self) -> int:
        return START_US + self.plant.sim_us

    def run(self, seconds: float) -> Iterator[None]:
        """Advance, yielding at 10 Hz."""
        samples: list[ImuSample] = []
        fix: GpsFix | None = None
        for _ in range(round(seconds * 100)):
            self.applied = self.adapter.decide(self.now_us)
            self.plant.step(self.applied.left_n, self.applied.right_n)
            now_us = self.now_us
            samples.append(imu_message(self.plant, now_us))
            if self.plant.steps % 20 == 0:
                fix = gps_message(self.plant, now_us)
            if self.plant.steps % 5 == 0:
                _, self.odometry = self.estimator.step(samples, fix, now_us)
                samples, fix = [], None
            if self.plant.steps % 10 == 0:
                self._guide(now_us)
                yield

    def settle(self, seconds: float) -> None:
        for _ in self.run(seconds):
            pass

    def _guide(self, now_us: int) -> None:
        arming = Arming(source_us=now_us, armed=self.armed)
        advisory = self.advisory or Advisory(source_us=now_us, direction=self.direction, reason=Reason.CENTER_CLEAR)
        inputs = NavigatorInputs(
            advisory=advisory,
            advisory_us=now_us,
            odometry=self.odometry,
            odometry_us=now_us,
            clock=SimTime(source_us=now_us, sim_us=self.plant.sim_us, stamp_us=now_us),
            clock_us=now_us,
            arming=arming,
            arming_us=now_us,
            evidence=self.evidence,
        )
        self.nav, self.command = navigate(
            self.nav, inputs, self.mission, now_us, DOMAIN, self.config.navigator, self.camera, self.planner
        )
        if self.heading_rad is not None:
            self.command = msgspec.structs.replace(self.command, heading_rad=self.heading_rad)
        if self.is_ordered_to_stand:
            self.command = msgspec.structs.replace(self.command, speed_mps=0.0)
        self.ctl, thrust = compute_thrust(
            self.ctl,
            ControllerInputs(self.command, now_us, self.odometry, now_us),
            now_us,
            DOMAIN,
            self.config.controller,
        )
        self.seq += 1
        self.thrust = msgspec.structs.replace(thrust, seq=self.seq, epoch=1, producer="controller")
        self.adapter.receive_arming(arming, now_us)
        for service in self.config.plant.adapter.require_pulses:
            self.adapter.receive_pulse(service, now_us)
        self.adapter.offer(self.thrust, now_us)


def open_water(name: str) -> World:
    """The world without obstacles, which constant STRAIGHT advice would run into."""
    return dataclasses.replace(load_world(name), obstacles=(), actors=())


def off_route_m(world: World, position_m: tuple[float, float]) -> float:
    """Distance of the true position from the nearest leg."""
    here = np.array(position_m)
    legs = np.roll(world.route_m, -1, axis=0) - world.route_m
    part = ((here - world.route_m) * legs).sum(1) / (legs * legs).sum(1)
    nearest = world.route_m + np.clip(part, 0.0, 1.0)[:, None] * legs
    return float(np.linalg.norm(here - nearest, axis=1).min())
