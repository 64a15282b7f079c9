"""What is known of the boat at one moment. Pure."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import msgspec

from paani import keys
from paani import messages as m
from paani.geometry import wrap_rad
from paani.missions import mission_of_route

# What each field of a snapshot is taken from.
TOPICS: Mapping[str, keys.Topic[Any]] = {
    "odometry": keys.ODOMETRY,
    "inertial": keys.LOCAL_ODOMETRY,
    "fix": keys.GPS,
    "operator": keys.OPERATOR_STATE,
    "applied": keys.THRUST_APPLIED,
    "command": keys.COMMAND,
    "advisory": keys.ADVISORY,
    "route": keys.ROUTE,
    "mission": keys.MISSION,
    "prediction": keys.PREDICTION,
    "shadow": keys.SHADOW,
    "thrusters": keys.THRUSTERS_STATE,
    "recorder": keys.RECORDER_STATE,
}


class Snapshot(msgspec.Struct, frozen=True, kw_only=True):
    """Every field is a message that is fresh by the limit of its topic, or None. boot_ms: since this process began."""

    now_us: int
    boot_ms: int = 0
    odometry: m.Odometry | None = None
    inertial: m.Odometry | None = None
    fix: m.GpsFix | None = None
    operator: m.OperatorState | None = None
    applied: m.ThrustApplied | None = None
    command: m.NavCommand | None = None
    advisory: m.Advisory | None = None
    route: m.Route | None = None
    mission: m.Mission | None = None
    prediction: m.Prediction | None = None
    shadow: m.Shadow | None = None
    thrusters: m.ThrustersState | None = None
    recorder: m.RecorderState | None = None

    @property
    def pose(self) -> m.Odometry | None:
        """The estimate, where the boat may be guided by it."""
        return self.odometry if self.odometry is not None and self.odometry.healthy else None

    @property
    def legs(self) -> tuple[m.MissionLeg, ...] | None:
        """What the boat is to do: its mission, or the route alone; None while neither is known."""
        if self.mission is not None:
            return self.mission.legs
        return None if self.route is None else mission_of_route(self.route).legs

    @property
    def fence(self) -> tuple[m.FenceArea, ...]:
        """Areas of the mission's fence; empty where there is none."""
        return self.mission.fence if self.mission is not None else ()

    @property
    def rally(self) -> tuple[m.Waypoint, ...]:
        """Places beside home that RETURN may lead to; empty where there are none."""
        return self.mission.rally if self.mission is not None else ()

    @property
    def is_armed(self) -> bool:
        """Whether the operator's process says that it is; what is not known is not armed."""
        return self.operator is not None and self.operator.armed and not self.operator.stopped


def velocity_mps(pose: m.Odometry) -> tuple[float, float]:
    """Velocity over ground, east and north [m/s]."""
    cosine, sine = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    return pose.surge_mps * cosine - pose.sway_mps * sine, pose.surge_mps * sine + pose.sway_mps * cosine


def attitude_rad(pose: m.Odometry) -> tuple[float, float, float]:
    """Roll, pitch and yaw of the axes forward, right, down in the frame north, east, down [rad]."""
    return pose.roll_rad, -pose.pitch_rad, wrap_rad(0.5 * math.pi - pose.yaw_rad)
