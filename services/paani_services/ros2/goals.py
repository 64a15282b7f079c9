"""A goal of ROS as a mission of one leg: go there and keep that station. Pure."""

from __future__ import annotations

import math
from typing import Any

from paani import messages as m

MAX_GOAL_AGE_S = 5.0  # by its header, where that has a stamp: what a bag plays again is no goal
MAX_GOAL_AHEAD_S = 1.0  # between the clocks of two machines


def leg_of_goal(goal: Any, map_frame: str, now_us: int, radius_m: float) -> m.MissionLeg:
    """The leg that a geometry_msgs/PoseStamped in the map asks for.

    A station is kept within the radius, at any heading: the goal's own, and its height, say nothing to a boat. Raises
    ValueError, in a few words, for another frame, a stamp that is too old or of the future, and what is no number.
    """
    header, at = goal.header, goal.pose.position
    if header.frame_id != map_frame:
        raise ValueError(f"frame '{header.frame_id[:40]}' is not '{map_frame}'")
    stamp_us = header.stamp.sec * 1_000_000 + header.stamp.nanosec // 1000
    if stamp_us and not -MAX_GOAL_AHEAD_S <= (now_us - stamp_us) * 1e-6 <= MAX_GOAL_AGE_S:
        raise ValueError("its stamp is too old, or of the future")
    if not (math.isfinite(at.x) and math.isfinite(at.y)):
        raise ValueError("a number is not finite")
    station = m.Waypoint(x_m=at.x, y_m=at.y)
    return m.MissionLeg(kind=m.LegKind.HOLD_STATION, waypoints=(station,), radius_m=radius_m)
