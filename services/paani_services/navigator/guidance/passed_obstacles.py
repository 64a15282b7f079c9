"""Memory of obstacles abeam: what was seen beside the bow is still there when the camera no longer sees it.

While an obstacle is remembered on one side, the course back to the route may not turn towards that side.
Used only where the metric planner is not: the planner remembers places itself.
"""

import math

import msgspec

from paani.geometry import wrap_rad
from paani.messages import Advisory, Odometry
from paani_services.navigator.guidance.visual_turns import TURN_SIDE


class SightingPose(msgspec.Struct, frozen=True):
    """Pose of the boat when an obstacle was last seen on one side."""

    x_m: float
    y_m: float
    yaw_rad: float


class PassedObstacles(msgspec.Struct, frozen=True):
    """Sides with a remembered obstacle, each with the pose from which it was last seen."""

    left: SightingPose | None = None
    right: SightingPose | None = None


def remember_obstacles(
    passed: PassedObstacles, advisory: Advisory, odometry: Odometry, clear_m: float
) -> PassedObstacles:
    """Remember a side that is occupied or that a turn leads away from, and forget it `clear_m` further on."""
    here = SightingPose(odometry.x_m, odometry.y_m, odometry.yaw_rad)
    turn_side = TURN_SIDE.get(advisory.direction, 0.0)

    def update_side(is_occupied: bool, is_turned_from: bool, before: SightingPose | None) -> SightingPose | None:
        if is_occupied or is_turned_from:
            return here
        if before is None or math.dist((before.x_m, before.y_m), (here.x_m, here.y_m)) > clear_m:
            return None
        return before

    return PassedObstacles(
        left=update_side(advisory.left.occupied, turn_side < 0.0, passed.left),
        right=update_side(advisory.right.occupied, turn_side > 0.0, passed.right),
    )


def limit_course_rad(course_rad: float, passed: PassedObstacles) -> float:
    """The course, turned towards a side with an obstacle no further than the yaw at which it was last seen."""
    if passed.right is not None and wrap_rad(course_rad - passed.right.yaw_rad) < 0.0:
        course_rad = passed.right.yaw_rad
    if passed.left is not None and wrap_rad(course_rad - passed.left.yaw_rad) > 0.0:
        course_rad = passed.left.yaw_rad
    return wrap_rad(course_rad)
