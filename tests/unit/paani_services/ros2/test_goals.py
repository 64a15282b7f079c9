"""A goal as a leg: where it lies, and what is no goal."""

from __future__ import annotations

import math
from typing import Any

import pytest

from paani import messages as m
from paani.missions import find_mission_fault
from paani_services.ros2 import schemas
from paani_services.ros2.goals import leg_of_goal

NOW_US = 1_700_000_000_000_000


def goal(x: float = 3.0, y: float = -4.0, *, frame: str = "otter/map", stamp_us: int = 0) -> Any:
    stamp = schemas.make("builtin_interfaces/Time", sec=stamp_us // 1_000_000, nanosec=stamp_us % 1_000_000 * 1000)
    header = schemas.make("std_msgs/Header", stamp=stamp, frame_id=frame)
    position = schemas.make("geometry_msgs/Point", x=x, y=y, z=7.0)
    orientation = schemas.make("geometry_msgs/Quaternion", x=0.0, y=0.0, z=1.0, w=0.0)
    pose = schemas.make("geometry_msgs/Pose", position=position, orientation=orientation)
    sent = schemas.encode(schemas.make("geometry_msgs/PoseStamped", header=header, pose=pose))
    return schemas.decode(sent, "geometry_msgs/PoseStamped")


@pytest.mark.parametrize("age_s", [None, 0.0, 4.9, -0.9])
def test_a_goal_is_a_station_of_the_map(age_s: float | None) -> None:
    """Without a stamp it is of now, as `ros2 topic pub` sends it."""
    stamp_us = 0 if age_s is None else NOW_US - round(age_s * 1e6)
    leg = leg_of_goal(goal(stamp_us=stamp_us), "otter/map", NOW_US, 2.5)
    station = m.Waypoint(x_m=3.0, y_m=-4.0)
    assert leg == m.MissionLeg(kind=m.LegKind.HOLD_STATION, waypoints=(station,), radius_m=2.5)
    assert find_mission_fault((leg,), (), 0.0) == ""


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"frame": "map"}, "frame 'map' is not 'otter/map'"),
        ({"frame": "otter/odom"}, "is not 'otter/map'"),
        ({"frame": ""}, "frame '' is not"),
        ({"frame": "x" * 5000}, "frame 'x{40}' is not"),
        ({"stamp_us": NOW_US - 5_100_000}, "too old"),
        ({"stamp_us": NOW_US + 1_100_000}, "of the future"),
        ({"x": math.nan}, "not finite"),
        ({"y": -math.inf}, "not finite"),
    ],
)
def test_what_is_no_goal_is_refused_with_the_reason(changes: dict[str, Any], reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        leg_of_goal(goal(**changes), "otter/map", NOW_US, 2.5)
