"""Position on a path of waypoints: the active leg, the cross-track error, and the line-of-sight course.

A leg is the straight line between two waypoints and is named by the index of the waypoint that ends it, the target.
Line-of-sight guidance after Fossen, Handbook of Marine Craft Hydrodynamics and Motion Control, section 12.3.
"""

import math
from typing import NamedTuple

from paani import portable
from paani.config import NavigatorConfig
from paani.fence_geometry import Point
from paani.messages import Odometry, Waypoint


class WaypointPath(NamedTuple):
    """At least two waypoints, followed in order; with `repeat` the last leads back to the first."""

    waypoints: tuple[Waypoint, ...]
    repeat: bool = False


def nearest_leg(path: WaypointPath, position_m: Point) -> int:
    """Target waypoint of the leg nearest to the boat, so that a path may be joined anywhere.

    Of two legs that are as near, to the millimetre, as where their corner is nearest, it is the first.
    """
    count = len(path.waypoints)
    targets = range(count) if path.repeat else range(1, count)
    return min(targets, key=lambda target: round(_distance_to_leg_m(path, target, position_m), 3))


def is_waypoint_reached(path: WaypointPath, target: int, position_m: Point, config: NavigatorConfig) -> bool:
    """Whether the boat is within `acceptance_m` (M2), or has left the waypoint behind within `pass_abeam_m`."""
    waypoint = path.waypoints[target]
    distance_m = math.dist(position_m, (waypoint.x_m, waypoint.y_m))
    if distance_m <= config.acceptance_m:
        return True
    return distance_m <= config.pass_abeam_m and _past_end_m2(leg_start(path, target), waypoint, position_m) > 0.0


def leg_start(path: WaypointPath, target: int) -> Waypoint:
    """The waypoint before the target; for the first waypoint of an open path, the second one mirrored in it."""
    if target > 0 or path.repeat:
        return path.waypoints[target - 1]
    first, second = path.waypoints[:2]
    return Waypoint(x_m=2.0 * first.x_m - second.x_m, y_m=2.0 * first.y_m - second.y_m)


def cross_track_error_m(path: WaypointPath, target: int, position_m: Point) -> float:
    """Signed distance from the infinite line through the leg, positive to its left."""
    start, end = leg_start(path, target), path.waypoints[target]
    leg_x_m, leg_y_m = end.x_m - start.x_m, end.y_m - start.y_m
    from_x_m, from_y_m = position_m[0] - start.x_m, position_m[1] - start.y_m
    return (leg_x_m * from_y_m - leg_y_m * from_x_m) / math.hypot(leg_x_m, leg_y_m)


def velocity_over_ground_mps(odometry: Odometry) -> tuple[float, float]:
    """Velocity towards east and north."""
    cosine, sine = portable.cos(odometry.yaw_rad), portable.sin(odometry.yaw_rad)
    return (
        odometry.surge_mps * cosine - odometry.sway_mps * sine,
        odometry.surge_mps * sine + odometry.sway_mps * cosine,
    )


def bearing_rad(position_m: Point, waypoint: Waypoint) -> float:
    """Bearing of a waypoint from the boat (M4), counter-clockwise from east."""
    return portable.atan2(waypoint.y_m - position_m[1], waypoint.x_m - position_m[0])


def line_of_sight_course_rad(
    path: WaypointPath, target: int, position_m: Point, lookahead_m: float, integral_offset_m: float = 0.0
) -> float:
    """Line-of-sight course: towards the point on the leg `lookahead_m` ahead, less the integral's offset (see `ilos`).

    With `lookahead_m` 0 it is the bearing of the target (M4). Past the end of the leg it is that bearing again,
    because the infinite line would lead the boat away from its path for ever.
    """
    start, end = leg_start(path, target), path.waypoints[target]
    if lookahead_m <= 0.0 or _past_end_m2(start, end, position_m) > 0.0:
        return bearing_rad(position_m, end)
    leg_rad = portable.atan2(end.y_m - start.y_m, end.x_m - start.x_m)
    return leg_rad - portable.atan2(cross_track_error_m(path, target, position_m) + integral_offset_m, lookahead_m)


def _past_end_m2(start: Waypoint, end: Waypoint, position_m: Point) -> float:
    """Distance past the end of the leg, measured along it, times the length of the leg: its sign is what counts."""
    leg_x_m, leg_y_m = end.x_m - start.x_m, end.y_m - start.y_m
    return (position_m[0] - end.x_m) * leg_x_m + (position_m[1] - end.y_m) * leg_y_m


def _distance_to_leg_m(path: WaypointPath, target: int, position_m: Point) -> float:
    """Distance from the leg itself, ends included."""
    start, end = leg_start(path, target), path.waypoints[target]
    leg_x_m, leg_y_m = end.x_m - start.x_m, end.y_m - start.y_m
    from_x_m, from_y_m = position_m[0] - start.x_m, position_m[1] - start.y_m
    fraction = (from_x_m * leg_x_m + from_y_m * leg_y_m) / (leg_x_m * leg_x_m + leg_y_m * leg_y_m)
    fraction = min(1.0, max(0.0, fraction))
    return math.hypot(from_x_m - fraction * leg_x_m, from_y_m - fraction * leg_y_m)
