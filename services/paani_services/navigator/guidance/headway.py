"""Whether the boat makes way along its path, and where that leads. Pure."""

import itertools
import math

import msgspec

from paani.clock import has_passed
from paani.config import PlannerConfig
from paani.fence_geometry import Point
from paani_services.navigator.guidance.mission_progress import LegSetpoint
from paani_services.navigator.guidance.path_progress import WaypointPath, leg_start

HEADWAY_M = 1.0  # nearer to the end of the leg than before: more than the GPS position strays in `planner.barred_s`
AHEAD_SPACING_M = 1.0  # between the points of the path


class Headway(msgspec.Struct, frozen=True):
    """waypoints_reached: of all legs, when it was noted. to_go_m: the least so far to the end of the leg, along it.

    since_us: when the boat last made headway.
    """

    waypoints_reached: int = -1
    to_go_m: float = 0.0
    since_us: int = 0


def note_headway(
    headway: Headway, setpoint: LegSetpoint, waypoints_reached: int, position_m: Point, now_us: int
) -> Headway:
    """The headway after this step. Where the leg follows no path, there is none to be barred."""
    to_go_m = 0.0 if setpoint.path is None else _to_go_m(setpoint.path, setpoint.target, position_m)
    is_same_leg = setpoint.path is not None and waypoints_reached == headway.waypoints_reached
    if is_same_leg and to_go_m > headway.to_go_m - HEADWAY_M:
        return headway
    return Headway(waypoints_reached, to_go_m, now_us)


def is_barred(headway: Headway, now_us: int, config: PlannerConfig) -> bool:
    """Whether the boat has made no headway for `barred_s`."""
    return config.barred_s > 0.0 and has_passed(headway.since_us, config.barred_s * 1e6, now_us)


def path_ahead_m(setpoint: LegSetpoint, position_m: Point, reach_m: float) -> list[Point]:
    """Points every `AHEAD_SPACING_M` along the path, from the one abeam of the boat on, up to `reach_m`."""
    if setpoint.path is None:
        return []
    path, target = setpoint.path, setpoint.target
    start, end, to_go_m = leg_start(path, target), path.waypoints[target], _to_go_m(path, target, position_m)
    leg_m = math.dist((start.x_m, start.y_m), (end.x_m, end.y_m))
    along = min(max(1.0 - to_go_m / leg_m, 0.0), 1.0)
    corners = [(start.x_m + along * (end.x_m - start.x_m), start.y_m + along * (end.y_m - start.y_m))]
    later = path.waypoints[target:] + (path.waypoints[:target] if path.repeat else ())
    corners += [(each.x_m, each.y_m) for each in later]
    points, travelled_m = [corners[0]], 0.0
    for before, after in itertools.pairwise(corners):
        count = math.ceil(math.dist(before, after) / AHEAD_SPACING_M)
        for step in range(1, count + 1):
            travelled_m += math.dist(before, after) / count
            if travelled_m > reach_m:
                return points
            part = step / count
            points.append((before[0] + part * (after[0] - before[0]), before[1] + part * (after[1] - before[1])))
    return points


def _to_go_m(path: WaypointPath, target: int, position_m: Point) -> float:
    """From the boat to the end of the leg, measured along it; negative past its end."""
    start, end = leg_start(path, target), path.waypoints[target]
    leg_x_m, leg_y_m = end.x_m - start.x_m, end.y_m - start.y_m
    off_m2 = (end.x_m - position_m[0]) * leg_x_m + (end.y_m - position_m[1]) * leg_y_m
    return off_m2 / math.hypot(leg_x_m, leg_y_m)
