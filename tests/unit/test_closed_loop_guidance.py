"""Plant, sensors, estimator, navigator, controller and adapter in one process, in lockstep."""

import math
import statistics
from collections.abc import Iterator

import msgspec
import pytest
from paani.config import Config, load_config
from paani.messages import (
    Advisory,
    Arming,
    Direction,
    NavCommand,
    Odometry,
    Pulse,
    Reason,
    Route,
    SimTime,
    Thrust,
    Waypoint,
    ZeroCause,
)
from paani_services.controller.control import ControlState, control
from paani_services.controller.control import Heard as ControllerHeard
from paani_services.localization.estimator import Estimator
from paani_services.navigator.navigate import Heard as NavigatorHeard
from paani_services.navigator.navigate import NavState, navigate
from paani_sim.plant.adapter import Applied, ThrustAdapter
from paani_sim.plant.plant import Plant
from paani_sim.plant.service import gps_message, imu_message
from paani_sim.worlds import World, load_world

START_US = 1_000_000
DOMAIN = 43


class Lockstep:
    """The guidance chain on one simulated clock: 100 Hz plant, 20 Hz estimator, 10 Hz guidance."""

    def __init__(self, world: World, config: Config, seed: int = 1) -> None:
        self.world, self.config = world, config
        self.plant = Plant(world, config.plant, seed)
        origin = {
            "origin_latitude_deg": world.origin_lat_deg,
            "origin_longitude_deg": world.origin_lon_deg,
        }
        self.estimator = Estimator(msgspec.structs.replace(config.localization, **origin))
        self.route = Route(
            source_us=0,
            name=world.name,
            waypoints=tuple(Waypoint(x_m=x, y_m=y) for x, y in world.route_m.tolist()),
        )
        self.nav, self.ctl = NavState(), ControlState()
        self.adapter = ThrustAdapter(config.plant.adapter, DOMAIN)
        self.direction = Direction.STRAIGHT
        self.armed = True
        self.command: NavCommand | None = None
        self.thrust: Thrust | None = None
        self.odometry: Odometry | None = None
        self.applied: Applied = self.adapter.decide(START_US)
        self.seq = 0

    @property
    def now_us(self) -> int:
        return START_US + self.plant.sim_us

    def run(self, seconds: float) -> Iterator[None]:
        """Advance, yielding at 10 Hz."""
        samples, fix = [], None
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
        advisory = Advisory(source_us=now_us, direction=self.direction, reason=Reason.CENTER_CLEAR)
        heard = NavigatorHeard(
            advisory=advisory,
            advisory_us=now_us,
            odometry=self.odometry,
            odometry_us=now_us,
            clock=SimTime(source_us=now_us, sim_us=self.plant.sim_us, stamp_us=now_us),
            clock_us=now_us,
            arming=arming,
            arming_us=now_us,
        )
        self.nav, self.command = navigate(
            self.nav, heard, self.route, now_us, DOMAIN, self.config.navigator
        )
        self.ctl, thrust = control(
            self.ctl,
            ControllerHeard(self.command, now_us, self.odometry, now_us),
            now_us,
            DOMAIN,
            self.config.controller,
        )
        self.seq += 1
        self.thrust = msgspec.structs.replace(thrust, seq=self.seq, epoch=1, producer="controller")
        self.adapter.hear_arming(arming, now_us)
        for service in self.config.plant.adapter.require_pulses:
            self.adapter.hear_pulse(service, now_us)
        self.adapter.offer(self.thrust, now_us)
