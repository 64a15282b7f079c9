"""How near the hull comes to everything solid, and what the camera could have seen of it. Pure numpy.

The hull is the outline around both floats: a rectangle with rounded corners.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from paani.arrays import F64
from paani_sim.trials.outlines import AFLOAT_Z_M
from paani_sim.vessels.vessel import Hull
from paani_sim.worlds import Actor, Obstacle, Pose2, World
from paani_sim.worlds.footprint import is_round, placed, shape_of

FAR_M = 12.0  # what is farther counts as this far
BANK = "bank"
SIGNS = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]], np.float64)
CHUNK = 32


@dataclass(frozen=True, eq=False)
class Course:
    """Where the boat was: `x_m`, `y_m`, `yaw_rad` `(n,)`, and how far along its path each actor was, `(n, actors)`."""

    hull: Hull
    x_m: F64
    y_m: F64
    yaw_rad: F64
    along_m: F64

    @property
    def core_m(self) -> F64:
        """Half length and half width of the hull without its rounding."""
        return np.array([0.5 * self.hull.length_m - self.hull.radius_m, 0.5 * self.hull.spacing_m])

    def part(self, chosen: slice) -> Course:
        """Some of the moments."""
        return Course(self.hull, self.x_m[chosen], self.y_m[chosen], self.yaw_rad[chosen], self.along_m[chosen])


def afloat(world: World) -> tuple[Obstacle | Actor, ...]:
    """What stands or moves in the water, within reach of a hull."""
    return (*(each for each in world.obstacles if each.base_z_m < AFLOAT_Z_M), *world.actors)


def clearances_m(world: World, course: Course) -> dict[str, F64]:
    """From the hull to each thing afloat, by id, and to the bank, `(n,)`; at most FAR_M, 0 where they overlap."""
    found = {}
    actors = [actor.id for actor in world.actors]
    for thing in afloat(world):
        if isinstance(thing, Actor):
            poses = actor_poses(thing, course.along_m[:, actors.index(thing.id)])
        else:
            poses = np.broadcast_to(np.array(thing.pose, np.float64), (len(course.x_m), 3))
        found[thing.id] = _to_thing_m(thing, poses, course)
    found[BANK] = _to_bank_m(world.shore_m, course)
    return found


def actor_poses(actor: Actor, along_m: F64) -> F64:
    """x, y, yaw `(n, 3)`, as `actor_at` gives them one by one."""
    line = np.vstack([actor.path_m, actor.path_m[:1]]) if actor.closed else actor.path_m
    arc_m = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])

    def at(where_m: F64) -> tuple[F64, F64]:
        held = where_m % arc_m[-1] if actor.closed else np.clip(where_m, 0.0, arc_m[-1])
        return np.interp(held, arc_m, line[:, 0]), np.interp(held, arc_m, line[:, 1])

    x, y = at(along_m)
    ahead, behind = at(along_m + 0.5 * actor.length_m), at(along_m - 0.5 * actor.length_m)
    east, north = ahead[0] - behind[0], ahead[1] - behind[1]
    past = (east == 0.0) & (north == 0.0)  # beyond an end it lies as it came there
    leg = np.where(along_m[past] > 0.0, len(line) - 2, 0)
    east[past], north[past] = (line[leg + 1] - line[leg]).T
    return np.column_stack([x, y, np.arctan2(north, east)])


def could_see(world: World, what: str, course: Course, half_fov_rad: float, range_m: float, ahead_m: float) -> bool:
    """Was any of it, at any of these moments, in the field of view, within range, and with nothing before it?

    what: the id of a thing, or BANK for the stretch of bank next to where the course ends. ahead_m: of the camera.
    """
    things = afloat(world)
    actors = [actor.id for actor in world.actors]
    last = len(course.x_m) - 1
    for k in range(last + 1):
        eye = np.array(
            [
                course.x_m[k] + ahead_m * np.cos(course.yaw_rad[k]),
                course.y_m[k] + ahead_m * np.sin(course.yaw_rad[k]),
            ]
        )
        outlines = {}
        for thing in things:
            if isinstance(thing, Actor):
                at = actor_poses(thing, course.along_m[k : k + 1, actors.index(thing.id)])[0]
                outlines[thing.id] = placed(shape_of(thing), Pose2(*at.tolist()))
            else:
                outlines[thing.id] = placed(shape_of(thing), thing.pose)
        if what == BANK:
            end = np.array([course.x_m[last], course.y_m[last]])
            targets = _nearest_on_edges(world.shore_m, end)[None, :]
        else:
            targets = np.vstack([outlines[what], outlines[what].mean(axis=0)])
        rel = targets - eye
        away_m = np.hypot(rel[:, 0], rel[:, 1])
        bearing = np.arctan2(rel[:, 1], rel[:, 0]) - course.yaw_rad[k]
        bearing = (bearing + np.pi) % (2.0 * np.pi) - np.pi
        shown = (away_m <= range_m) & (np.abs(bearing) <= half_fov_rad)
        if not shown.any():
            continue
        walls = [np.stack([o, np.roll(o, -1, axis=0)], axis=1) for name, o in outlines.items() if name != what]
        if what != BANK:
            walls.append(np.stack([world.shore_m, np.roll(world.shore_m, -1, axis=0)], axis=1))
        segments = np.concatenate(walls) if walls else np.empty((0, 2, 2))
        if any(not _is_crossed(eye, target, segments) for target in targets[shown]):
            return True
    return False


def _to_thing_m(thing: Obstacle | Actor, poses: F64, course: Course) -> F64:
    away = np.full(len(course.x_m), FAR_M)
    reach_m = 0.5 * float(np.hypot(thing.length_m, thing.width_m)) + float(np.hypot(*course.core_m)) + FAR_M
    near = np.flatnonzero(np.hypot(poses[:, 0] - course.x_m, poses[:, 1] - course.y_m) < reach_m)
    if not len(near):
        return away
    rel = _into_hull(poses[near, :2][:, None, :], course, near)
    if is_round(thing):
        gap = _to_core_m(rel, course.core_m)[:, 0] - 0.5 * thing.width_m
    else:
        shape = shape_of(thing)
        turn = poses[near, 2] - course.yaw_rad[near]
        cos, sin = np.cos(turn)[:, None], np.sin(turn)[:, None]
        corners = rel + np.stack(
            [cos * shape[:, 0] - sin * shape[:, 1], sin * shape[:, 0] + cos * shape[:, 1]], axis=-1
        )
        mine = np.broadcast_to(course.core_m * SIGNS, (len(near), *SIGNS.shape))
        gap = np.minimum(_to_core_m(corners, course.core_m).min(axis=1), _to_polygon_m(mine, corners).min(axis=1))
    away[near] = np.clip(gap - course.hull.radius_m, 0.0, FAR_M)
    return away


def _to_bank_m(shore_m: F64, course: Course) -> F64:
    away = np.full(len(course.x_m), FAR_M)
    ends_m = np.roll(shore_m, -1, axis=0)
    low, high = np.minimum(shore_m, ends_m), np.maximum(shore_m, ends_m)
    for first in range(0, len(away), CHUNK):
        part = np.arange(first, min(first + CHUNK, len(away)))
        place = np.column_stack([course.x_m[part], course.y_m[part]])
        reach_m = FAR_M + 1.0
        near = ((low < place.max(axis=0) + reach_m) & (high > place.min(axis=0) - reach_m)).all(axis=1)
        if not near.any():
            continue
        start = _into_hull(shore_m[near][None], course, part)
        end = _into_hull(ends_m[near][None], course, part)
        gap = _to_core_m(start, course.core_m).min(axis=1)
        for corner in course.core_m * SIGNS:
            gap = np.minimum(gap, _to_segments_m(corner, start, end).min(axis=1))
        away[part] = np.clip(gap - course.hull.radius_m, 0.0, FAR_M)
    return away


def _into_hull(points: F64, course: Course, part: NDArray[np.int_]) -> F64:
    """Map points `(n or 1, k, 2)` in the hull's frame at each moment, `(n, k, 2)`."""
    x = points[..., 0] - course.x_m[part][:, None]
    y = points[..., 1] - course.y_m[part][:, None]
    cos, sin = np.cos(course.yaw_rad[part])[:, None], np.sin(course.yaw_rad[part])[:, None]
    return np.stack([cos * x + sin * y, cos * y - sin * x], axis=-1)


def _to_core_m(points: F64, core_m: F64) -> F64:
    """Distance of points `(..., 2)` to the rectangle about the origin; 0 inside."""
    outside = np.maximum(np.abs(points) - core_m, 0.0)
    return np.hypot(outside[..., 0], outside[..., 1])


def _to_segments_m(point: F64, start: F64, end: F64) -> F64:
    """Distance of one point to segments `(..., 2)`."""
    leg, rel = end - start, point - start
    part = np.clip((rel * leg).sum(-1) / np.maximum((leg * leg).sum(-1), 1e-12), 0.0, 1.0)
    gap = rel - part[..., None] * leg
    return np.asarray(np.hypot(gap[..., 0], gap[..., 1]), np.float64)


def _to_polygon_m(points: F64, corners: F64) -> F64:
    """Distance `(n, k)` of points `(n, k, 2)` to convex polygons `(n, c, 2)`, counter-clockwise; 0 inside."""
    best = np.full(points.shape[:2], np.inf)
    inside = np.ones(points.shape[:2], np.bool_)
    for c in range(corners.shape[1]):
        start, end = corners[:, c, None, :], corners[:, (c + 1) % corners.shape[1], None, :]
        leg, rel = end - start, points - start
        inside &= leg[..., 0] * rel[..., 1] - leg[..., 1] * rel[..., 0] >= 0.0
        part = np.clip((rel * leg).sum(-1) / np.maximum((leg * leg).sum(-1), 1e-12), 0.0, 1.0)
        gap = rel - part[..., None] * leg
        best = np.minimum(best, np.hypot(gap[..., 0], gap[..., 1]))
    return np.where(inside, 0.0, best)


def _nearest_on_edges(polygon_m: F64, point: F64) -> F64:
    leg = np.roll(polygon_m, -1, axis=0) - polygon_m
    rel = point - polygon_m
    part = np.clip((rel * leg).sum(-1) / np.maximum((leg * leg).sum(-1), 1e-12), 0.0, 1.0)
    at = polygon_m + part[:, None] * leg
    nearest: F64 = at[int(np.argmin(((at - point) ** 2).sum(axis=1)))]
    return nearest


def _is_crossed(eye: F64, target: F64, segments: Sequence[F64] | F64) -> bool:
    """Does any segment `(n, 2, 2)` lie between the two? What lies just before the target does not count."""
    if not len(segments):
        return False
    walls = np.asarray(segments)
    way, start, leg = target - eye, walls[:, 0] - eye, walls[:, 1] - walls[:, 0]
    cross = way[0] * leg[:, 1] - way[1] * leg[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        along = (start[:, 0] * leg[:, 1] - start[:, 1] * leg[:, 0]) / cross
        part = (start[:, 0] * way[1] - start[:, 1] * way[0]) / cross
    return bool(((along > 0.0) & (along < 0.98) & (part >= 0.0) & (part <= 1.0)).any())
