"""Paths of moving things that meet the boat, and when they start.

The boat is assumed to move along its route at `boat_mps`, and to be at `meets_at_m` when they are.
"""

import math
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from paani.arrays import F64
from paani_sim.worlds.curves import clearance_m, sampled_legs
from paani_sim.worlds.passability import obstacle_distance_m
from paani_sim.worlds.route_frame import RouteFrame
from paani_sim.worlds.world import Actor, Pose2, World

NOMINAL_BOAT_MPS = 0.6
MAX_LEAD_M = 60.0  # longest stretch of a path before the meeting
OVERRUN_M = 25.0  # of a path, past the boat's start or the route's end
PATH_MARGIN_M = 0.4
TRIM_STEP_M = 1.0


class Encounter(StrEnum):
    """How a moving thing meets the boat."""

    CROSSING = "crossing"
    HEAD_ON = "head_on"
    OVERTAKING = "overtaking"
    DRIFTING = "drifting"


class TimedPath(NamedTuple):
    """An open path, and the time and the distance along it at which a thing starts."""

    path_m: F64
    start_m: float
    start_s: float


def plan_crossing(
    world: World,
    route: RouteFrame,
    meets_at_m: float,
    *,
    speed_mps: float,
    length_m: float,
    turn_rad: float,
    boat_mps: float,
) -> TimedPath | None:
    """Straight across the route, `turn_rad` to the left of its heading, from bank to bank.

    None where something stands in its way within half its length of the boat's.
    """
    middle = route.pose_at(meets_at_m, 0.0, turn_rad)
    before_m = _open_water_ahead_m(world, middle, -1.0, length_m)
    after_m = _open_water_ahead_m(world, middle, 1.0, length_m)
    if min(before_m, after_m) < 0.5 * length_m:
        return None
    ends = [_point_ahead(middle, -before_m), _point_ahead(middle, after_m)]
    return _time_path(np.array(ends), before_m, meets_at_m / boat_mps, speed_mps)


def plan_head_on(
    route: RouteFrame, meets_at_m: float, *, speed_mps: float, left_m: float, boat_mps: float
) -> TimedPath:
    """Against the boat along its route, `left_m` to the left of it, until past the boat's start."""
    at_s = meets_at_m / boat_mps
    first_m = meets_at_m + min(MAX_LEAD_M, max(speed_mps * at_s, 1.0))
    return _time_path(route.line_m(first_m, -OVERRUN_M, left_m), first_m - meets_at_m, at_s, speed_mps)


def plan_overtaking(
    route: RouteFrame, meets_at_m: float, length_m: float, *, speed_mps: float, left_m: float, boat_mps: float
) -> TimedPath:
    """Up the boat's way with it, beside it at the meeting; `length_m` is the way's. Faster or slower than the boat."""
    at_s = meets_at_m / boat_mps
    first_m = meets_at_m - speed_mps * at_s
    line_m = route.line_m(first_m, max(length_m, meets_at_m) + OVERRUN_M, left_m)
    return TimedPath(line_m, 0.0, 0.0)


def plan_drifting(
    world: World,
    route: RouteFrame,
    meets_at_m: float,
    *,
    speed_mps: float,
    toward_rad: float,
    left_m: float,
    boat_mps: float,
) -> TimedPath | None:
    """Straight with wind or current through a point beside the way; None where that point is not afloat."""
    x_m, y_m, _ = route.pose_at(meets_at_m, left_m)
    middle = Pose2(x_m, y_m, toward_rad)
    if _open_water_ahead_m(world, middle, 1.0, 4.0) <= 0.0:
        return None
    at_s = meets_at_m / boat_mps
    before_m = min(_open_water_ahead_m(world, middle, -1.0, 4.0), speed_mps * at_s)
    after_m = min(_open_water_ahead_m(world, middle, 1.0, 4.0), speed_mps * 3.0 * at_s + 2.0)
    return _time_path(
        np.array([_point_ahead(middle, -before_m), _point_ahead(middle, after_m)]), before_m, at_s, speed_mps
    )


def is_path_clear(world: World, actor: Actor) -> bool:
    """Whether the actor keeps off the banks and the obstacles all along its path."""
    points_m = np.concatenate(sampled_legs(actor.path_m, 1.0, closed=actor.closed))
    half_m = 0.5 * actor.width_m + PATH_MARGIN_M
    return bool(
        (clearance_m(world.shore_m, points_m) > half_m).all()
        and (obstacle_distance_m(world.obstacles, points_m) > half_m).all()
    )


def trim_to_clear(
    world: World, timed_path: TimedPath, speed_mps: float, meets_at_m: float, width_m: float
) -> TimedPath | None:
    """The part of a path around the meeting that keeps off banks and obstacles; None where it does not there.

    Who would come from before it waits at its beginning, to be at the meeting at the same time as without this.
    """
    path_m, half_m = timed_path.path_m, 0.5 * width_m + PATH_MARGIN_M
    arc_m = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path_m, axis=0).T))])
    fine_m = np.arange(0.0, float(arc_m[-1]), TRIM_STEP_M)
    points_m = np.column_stack([np.interp(fine_m, arc_m, path_m[:, k]) for k in (0, 1)])
    free = (clearance_m(world.shore_m, points_m) > half_m) & (obstacle_distance_m(world.obstacles, points_m) > half_m)
    meeting_m = timed_path.start_m + speed_mps * (meets_at_m / NOMINAL_BOAT_MPS - timed_path.start_s)
    middle = min(int(meeting_m / TRIM_STEP_M), len(free) - 1)
    blocked = np.flatnonzero(~free)
    first, last = blocked[blocked < middle].max(initial=-1) + 1, blocked[blocked > middle].min(initial=len(free)) - 1
    if not free[middle] or last - first < 2:
        return None
    late_m = max(0.0, float(fine_m[first]) - timed_path.start_m)
    return TimedPath(
        points_m[first : last + 1],
        max(0.0, timed_path.start_m - float(fine_m[first])),
        timed_path.start_s + late_m / speed_mps,
    )


def is_afloat(world: World, points_m: F64, room_m: float) -> bool:
    """Whether all points are in the water and this far from its edge."""
    return bool((clearance_m(world.shore_m, points_m) > room_m).all())


def _time_path(path_m: F64, before_m: float, at_s: float, speed_mps: float) -> TimedPath:
    """Along the path so that `before_m` of it is done at `at_s`: later, or already some way down it."""
    start_s = at_s - before_m / speed_mps
    return TimedPath(path_m, max(0.0, -start_s) * speed_mps, max(0.0, start_s))


def _open_water_ahead_m(world: World, pose: Pose2, sense: float, length_m: float) -> float:
    """How far a thing of this length can go ahead (or astern) of the pose, `MAX_LEAD_M` at most."""
    reach_m = np.arange(0.0, MAX_LEAD_M + 0.5 * length_m, 0.5)
    points_m = np.array([_point_ahead(pose, sense * float(distance_m)) for distance_m in reach_m])
    free = (clearance_m(world.shore_m, points_m) > 1.0) & (obstacle_distance_m(world.obstacles, points_m) > 1.0)
    reached = len(reach_m) if free.all() else int(np.argmin(free))
    return max(0.0, 0.5 * (reached - 1) - 0.5 * length_m)


def _point_ahead(pose: Pose2, distance_m: float) -> tuple[float, float]:
    return (pose.x_m + distance_m * math.cos(pose.yaw_rad), pose.y_m + distance_m * math.sin(pose.yaw_rad))
