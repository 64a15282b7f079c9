"""Where the boat is on a track: which waypoint is next, the leg to it, and the course to steer."""

import math
from typing import NamedTuple

from paani import portable
from paani.config import NavigatorConfig
from paani.messages import Odometry, Waypoint

Point = tuple[float, float]
MIN_LEG_M = 0.01  # two waypoints nearer than this are the same


class Track(NamedTuple):
    """Two waypoints or more, followed in order; where `repeat`, the last leads back to the first."""

    waypoints: tuple[Waypoint, ...]
    repeat: bool = False


def first_target(track: Track, position_m: Point) -> int:
    """Index of the waypoint that ends the leg nearest to the boat, so that one may join anywhere."""
    count = len(track.waypoints)
    ends = range(count) if track.repeat else range(1, count)
    return min(ends, key=lambda end: _distance_to_leg_m(track, end, position_m))


def is_reached(track: Track, target: int, position_m: Point, config: NavigatorConfig) -> bool:
    """Within the acceptance radius (M2), or just left abeam where the configuration allows it."""
    waypoint = track.waypoints[target]
    to_go_m = math.dist(position_m, (waypoint.x_m, waypoint.y_m))
    if to_go_m <= config.acceptance_m:
        return True
    return to_go_m <= config.pass_abeam_m and _beyond_m2(leg_start(track, target), waypoint, position_m) > 0.0


def leg_start(track: Track, target: int) -> Waypoint:
    """The waypoint before; of an open track's first leg, its second waypoint mirrored."""
    if target > 0 or track.repeat:
        return track.waypoints[target - 1]
    first, second = track.waypoints[:2]
    return Waypoint(x_m=2.0 * first.x_m - second.x_m, y_m=2.0 * first.y_m - second.y_m)


def cross_track_m(track: Track, target: int, position_m: Point) -> float:
    """Signed distance from the leg's line, positive to its left."""
    start, end = leg_start(track, target), track.waypoints[target]
    along_x, along_y = end.x_m - start.x_m, end.y_m - start.y_m
    from_x, from_y = position_m[0] - start.x_m, position_m[1] - start.y_m
    return (along_x * from_y - along_y * from_x) / math.hypot(along_x, along_y)


def over_ground_mps(odometry: Odometry) -> tuple[float, float]:
    """Velocity towards east and north."""
    cosine, sine = portable.cos(odometry.yaw_rad), portable.sin(odometry.yaw_rad)
    return (
        odometry.surge_mps * cosine - odometry.sway_mps * sine,
        odometry.surge_mps * sine + odometry.sway_mps * cosine,
    )


def bearing_rad(position_m: Point, to: Waypoint) -> float:
    """Direction of a point (M4)."""
    return portable.atan2(to.y_m - position_m[1], to.x_m - position_m[0])


def course_rad(track: Track, target: int, position_m: Point, lookahead_m: float, crab_m: float = 0.0) -> float:
    """Bearing of the waypoint (M4), or of the point on the leg's line `lookahead_m` ahead, held up by `crab_m`.

    Beyond the leg's end it is the bearing again: no line leads a boat away from its route for ever. Line of sight:
    Fossen, Handbook of Marine Craft Hydrodynamics and Motion Control, section 12.3; `crab_m` is what
    `crab.offset_m` has learned to add to the cross-track distance.
    """
    start, end = leg_start(track, target), track.waypoints[target]
    if lookahead_m <= 0.0 or _beyond_m2(start, end, position_m) > 0.0:
        return bearing_rad(position_m, end)
    leg_rad = portable.atan2(end.y_m - start.y_m, end.x_m - start.x_m)
    return leg_rad - portable.atan2(cross_track_m(track, target, position_m) + crab_m, lookahead_m)


def _beyond_m2(start: Waypoint, end: Waypoint, position_m: Point) -> float:
    """How far past the leg's end, along it, times its length."""
    along_x, along_y = end.x_m - start.x_m, end.y_m - start.y_m
    return (position_m[0] - end.x_m) * along_x + (position_m[1] - end.y_m) * along_y


def _distance_to_leg_m(track: Track, target: int, position_m: Point) -> float:
    start, end = leg_start(track, target), track.waypoints[target]
    along_x, along_y = end.x_m - start.x_m, end.y_m - start.y_m
    from_x, from_y = position_m[0] - start.x_m, position_m[1] - start.y_m
    part = (from_x * along_x + from_y * along_y) / (along_x * along_x + along_y * along_y)
    part = min(1.0, max(0.0, part))
    return math.hypot(from_x - part * along_x, from_y - part * along_y)
