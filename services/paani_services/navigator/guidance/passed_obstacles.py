"""What was close beside the bow is still there when the camera no longer sees it.

While a side is guarded, the way back to the route may not turn towards it: the boat first goes past.
"""

import math

import msgspec

from paani.geometry import wrap_rad
from paani.messages import Advisory, Odometry
from paani_services.navigator.guidance.visual_turns import SIDE


class Guard(msgspec.Struct, frozen=True):
    """Where and on which heading the boat was when something was last seen on one side."""

    x_m: float
    y_m: float
    yaw_rad: float


class Guards(msgspec.Struct, frozen=True):
    """Sides that the course may not turn towards."""

    left: Guard | None = None
    right: Guard | None = None


def watch(guards: Guards, advisory: Advisory, odometry: Odometry, clear_m: float) -> Guards:
    """Guard a side that is occupied, or that a turn leads away from, until `clear_m` beyond the last such advice."""
    here = Guard(odometry.x_m, odometry.y_m, odometry.yaw_rad)
    turning = SIDE.get(advisory.direction, 0.0)  # positive to the left, away from the right

    def side(occupied: bool, turned_from: bool, before: Guard | None) -> Guard | None:
        if occupied or turned_from:
            return here
        if before is None or math.dist((before.x_m, before.y_m), (here.x_m, here.y_m)) > clear_m:
            return None
        return before

    return Guards(
        left=side(advisory.left.occupied, turning < 0.0, guards.left),
        right=side(advisory.right.occupied, turning > 0.0, guards.right),
    )


def guarded_course(course_rad: float, guards: Guards) -> float:
    """The course, turned no further towards a guarded side than the heading on which it was guarded."""
    if guards.right is not None and wrap_rad(course_rad - guards.right.yaw_rad) < 0.0:
        course_rad = guards.right.yaw_rad
    if guards.left is not None and wrap_rad(course_rad - guards.left.yaw_rad) > 0.0:
        course_rad = guards.left.yaw_rad
    return wrap_rad(course_rad)
