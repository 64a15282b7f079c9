"""A simulated boat for guidance alone: it turns and accelerates with a lag, drifts with the water, obeys `navigate`."""

from __future__ import annotations

import math
from collections.abc import Iterator

from paani.config import NavigatorConfig
from paani.geometry import clip, wrap_rad
from paani.messages import (
    Advisory,
    Arming,
    Direction,
    Mission,
    NavCommand,
    Odometry,
    Reason,
    SimTime,
)
from paani_services.navigator.interlocks import NavigatorInputs
from paani_services.navigator.navigate import NavigatorState, navigate

STEP_S = 0.1
TURN_RADPS, TURN_LAG_S, SPEED_LAG_S = 0.35, 1.5, 2.0
START_US = 1_000_000


class DriftingBoat:
    """`drift_mps` is the drift of the water, east and north. Position and speed are estimated without error."""

    def __init__(
        self,
        mission: Mission,
        config: NavigatorConfig,
        at_m: tuple[float, float] = (0.0, 0.0),
        yaw_rad: float = 0.0,
        drift_mps: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        self.mission, self.config, self.drift_mps = mission, config, drift_mps
        (self.x_m, self.y_m), self.yaw_rad, self.speed_mps = at_m, yaw_rad, 0.0
        self.direction, self.armed, self.stopped, self.epoch = Direction.STRAIGHT, True, False, 1
        self.now_us, self.state = START_US, NavigatorState()
        self.order: NavCommand | None = None

    @property
    def position_m(self) -> tuple[float, float]:
        return self.x_m, self.y_m

    def run(self, seconds: float) -> Iterator[NavCommand]:
        """Advance, and yield each order at 10 Hz."""
        for _ in range(round(seconds / STEP_S)):
            self.now_us += round(STEP_S * 1e6)
            self.state, self.order = navigate(self.state, self._inputs(), self.mission, self.now_us, 43, self.config)
            self._move(self.order)
            yield self.order

    def settle(self, seconds: float) -> NavCommand:
        """Advance, and return the last order."""
        for _ in self.run(seconds):
            pass
        assert self.order is not None
        return self.order

    def _inputs(self) -> NavigatorInputs:
        now_us, yaw_rad = self.now_us, self.yaw_rad
        east_mps, north_mps = self.drift_mps
        return NavigatorInputs(
            advisory=Advisory(source_us=now_us, direction=self.direction, reason=Reason.CENTER_CLEAR),
            advisory_us=now_us,
            odometry=Odometry(
                source_us=now_us,
                x_m=self.x_m,
                y_m=self.y_m,
                yaw_rad=yaw_rad,
                surge_mps=self.speed_mps + east_mps * math.cos(yaw_rad) + north_mps * math.sin(yaw_rad),
                sway_mps=north_mps * math.cos(yaw_rad) - east_mps * math.sin(yaw_rad),
                healthy=True,
            ),
            odometry_us=now_us,
            clock=SimTime(source_us=now_us, sim_us=now_us, stamp_us=now_us),
            clock_us=now_us,
            arming=Arming(source_us=now_us, armed=self.armed, stopped=self.stopped, epoch=self.epoch),
            arming_us=now_us,
        )

    def _move(self, order: NavCommand) -> None:
        wanted_mps = order.speed_mps if order.enable else 0.0
        self.speed_mps += (wanted_mps - self.speed_mps) * STEP_S / SPEED_LAG_S
        if order.enable:
            error_rad = wrap_rad(order.heading_rad - self.yaw_rad)
            self.yaw_rad += clip(error_rad / TURN_LAG_S, -TURN_RADPS, TURN_RADPS) * STEP_S
        self.x_m += (self.speed_mps * math.cos(self.yaw_rad) + self.drift_mps[0]) * STEP_S
        self.y_m += (self.speed_mps * math.sin(self.yaw_rad) + self.drift_mps[1]) * STEP_S
