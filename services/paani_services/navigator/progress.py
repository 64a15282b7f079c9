"""Where the boat is on its route: which waypoint is next, the leg to it, and the course to steer."""

import math

from paani import portable
from paani.config import NavigatorConfig
from paani.messages import Route, Waypoint

Point = tuple[float, float]


def first_target(route: Route, position_m: Point) -> int:
    """Index of the waypoint that ends the leg nearest to the boat, so that one may join anywhere."""
    count = len(route.waypoints)
    ends = range(count) if route.repeat else range(1, count)
    return min(ends, key=lambda end: _distance_to_leg_m(route, end, position_m))


def is_reached(route: Route, target: int, position_m: Point, config: NavigatorConfig) -> bool:
    """Within the acceptance radius (M2), or just left abeam where the configuration allows it."""
    waypoint = route.waypoints[target]
    to_go_m = math.dist(position_m, (waypoint.x_m, waypoint.y_m))
    if to_go_m <= config.acceptance_m:
        return True
    start = leg_start(route, target)
    along_x, along_y = waypoint.x_m - start.x_m, waypoint.y_m - start.y_m
    beyond = (position_m[0] - waypoint.x_m) * along_x + (position_m[1] - waypoint.y_m) * along_y
    return to_go_m <= config.pass_abeam_m and beyond > 0.0


def leg_start(route: Route, target: int) -> Waypoint:
    """The waypoint before; of an open route's first leg, its second waypoint mirrored."""
    if target > 0 or route.repeat:
        return route.waypoints[target - 1]
    first, second = route.waypoints[:2]
    return Waypoint(x_m=2.0 * first.x_m - second.x_m, y_m=2.0 * first.y_m - second.y_m)


def cross_track_m(route: Route, target: int, position_m: Point) -> float:
    """Signed distance from the leg's line, positive to its left."""
    start, end = leg_start(route, target), route.waypoints[target]
    along_x, along_y = end.x_m - start.x_m, end.y_m - start.y_m
    from_x, from_y = position_m[0] - start.x_m, position_m[1] - start.y_m
    return (along_x * from_y - along_y * from_x) / math.hypot(along_x, along_y)


def course_rad(route: Route, target: int, position_m: Point, lookahead_m: float) -> float:
    """Bearing of the waypoint (M4), or of the point on the leg's line `lookahead_m` ahead.

    Line of sight: Fossen, Handbook of Marine Craft Hydrodynamics and Motion Control, section 12.3.
    """
    start, end = leg_start(route, target), route.waypoints[target]
    if lookahead_m <= 0.0:
        return portable.atan2(end.y_m - position_m[1], end.x_m - position_m[0])
    leg_rad = portable.atan2(end.y_m - start.y_m, end.x_m - start.x_m)
    return leg_rad - portable.atan2(cross_track_m(route, target, position_m), lookahead_m)


def _distance_to_leg_m(route: Route, target: int, position_m: Point) -> float:
    start, end = leg_start(route, target), route.waypoints[target]
    along_x, along_y = end.x_m - start.x_m, end.y_m - start.y_m
    from_x, from_y = position_m[0] - start.x_m, position_m[1] - start.y_m
    part = (from_x * along_x + from_y * along_y) / (along_x * along_x + along_y * along_y)
    part = min(1.0, max(0.0, part))
    return math.hypot(from_x - part * along_x, from_y - part * along_y)
