"""Clearance between hull and everything solid along a path, and visibility of things to the camera. Pure numpy.

The hull is the outline around both floats: a rectangle with rounded corners.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from paani.arrays import F64
from paani_sim.vessels.vessel import Hull
from paani_sim.worlds import Actor, Obstacle, Pose2, World
from paani_sim.worlds.footprint import build_outline, is_round, place_outline
from paani_sim.worlds.passability import HEADROOM_M

MAX_CLEARANCE_M = 12.0  # larger clearances count as this
BANK = "bank"
CORNER_SIGNS = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]], np.float64)
MOMENTS_PER_CHUNK = 32
OUTLINE_SPACING_M = 0.2  # of the places of an outline that are looked at


@dataclass(frozen=True, eq=False)
class HullPath:
    """Path of the hull: `x_m`, `y_m`, `yaw_rad` `(n,)`, and distance of each actor along its path, `(n, actors)`."""

    hull: Hull
    x_m: F64
    y_m: F64
    yaw_rad: F64
    along_m: F64

    @property
    def core_m(self) -> F64:
        """Half length and half width of the hull without its rounding."""
        return np.array([0.5 * self.hull.length_m - self.hull.radius_m, 0.5 * self.hull.spacing_m])

    def slice_moments(self, chosen: slice) -> HullPath:
        """The path at some of its moments."""
        return HullPath(self.hull, self.x_m[chosen], self.y_m[chosen], self.yaw_rad[chosen], self.along_m[chosen])


def list_waterborne(world: World) -> tuple[Obstacle | Actor, ...]:
    """Things that stand or move in the water, low enough for a hull to touch."""
    return (*(each for each in world.obstacles if each.base_z_m <= HEADROOM_M), *world.actors)


def compute_clearances_m(world: World, hull_path: HullPath) -> dict[str, F64]:
    """From the hull to each thing afloat, by id, and to the bank, `(n,)`; at most `MAX_CLEARANCE_M`, 0 in them."""
    found = {}
    actors = [actor.id for actor in world.actors]
    for thing in list_waterborne(world):
        if isinstance(thing, Actor):
            poses = compute_actor_poses(thing, hull_path.along_m[:, actors.index(thing.id)])
        else:
            poses = np.broadcast_to(np.array(thing.pose, np.float64), (len(hull_path.x_m), 3))
        found[thing.id] = _distance_to_thing_m(thing, poses, hull_path)
    found[BANK] = _distance_to_bank_m(world.shore_m, hull_path)
    return found


def compute_actor_poses(actor: Actor, along_m: F64) -> F64:
    """x, y, yaw `(n, 3)`, as `actor_pose_along` gives them one by one."""
    line = np.vstack([actor.path_m, actor.path_m[:1]]) if actor.closed else actor.path_m
    arc_m = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])

    def at(where_m: F64) -> tuple[F64, F64]:
        held = where_m % arc_m[-1] if actor.closed else np.clip(where_m, 0.0, arc_m[-1])
        return np.interp(held, arc_m, line[:, 0]), np.interp(held, arc_m, line[:, 1])

    x, y = at(along_m)
    ahead, behind = at(along_m + 0.5 * actor.length_m), at(along_m - 0.5 * actor.length_m)
    east, north = ahead[0] - behind[0], ahead[1] - behind[1]
    past = (east == 0.0) & (north == 0.0)  # beyond an end of its path an actor keeps its last heading
    leg = np.where(along_m[past] > 0.0, len(line) - 2, 0)
    east[past], north[past] = (line[leg + 1] - line[leg]).T
    return np.column_stack([x, y, np.arctan2(north, east)])


def was_visible(
    world: World,
    what: str,
    hull_path: HullPath,
    half_fov_rad: float,
    range_m: float,
    ahead_m: float,
    height_m: float = 0.0,
) -> bool:
    """Whether any part of a thing was, at any of these moments, in the field of view, in range and not occluded.

    what: the id of a thing, or BANK for the stretch of bank next to where the course ends. ahead_m, height_m: of the
    camera, which sees over everything that is lower.
    """
    things = list_waterborne(world)
    actors = [actor.id for actor in world.actors]
    bases_m = {each.id: each.base_z_m for each in world.obstacles}
    tops_m = {each.id: bases_m.get(each.id, 0.0) + each.height_m for each in things}
    last = len(hull_path.x_m) - 1
    for k in range(last + 1):
        camera_m = np.array(
            [
                hull_path.x_m[k] + ahead_m * np.cos(hull_path.yaw_rad[k]),
                hull_path.y_m[k] + ahead_m * np.sin(hull_path.yaw_rad[k]),
            ]
        )
        outlines = {}
        for thing in things:
            if isinstance(thing, Actor):
                at = compute_actor_poses(thing, hull_path.along_m[k : k + 1, actors.index(thing.id)])[0]
                outlines[thing.id] = place_outline(build_outline(thing), Pose2(*at.tolist()))
            else:
                outlines[thing.id] = place_outline(build_outline(thing), thing.pose)
        if what == BANK:
            end = np.array([hull_path.x_m[last], hull_path.y_m[last]])
            targets = _find_nearest_on_edges(world.shore_m, end)[None, :]
        else:
            targets = np.vstack([_walk_round(outlines[what]), outlines[what].mean(axis=0)])
        rel = targets - camera_m
        distance_m = np.hypot(rel[:, 0], rel[:, 1])
        bearing = np.arctan2(rel[:, 1], rel[:, 0]) - hull_path.yaw_rad[k]
        bearing = (bearing + np.pi) % (2.0 * np.pi) - np.pi
        in_view = (distance_m <= range_m) & (np.abs(bearing) <= half_fov_rad)
        if not in_view.any():
            continue
        occluders = [
            np.stack([o, np.roll(o, -1, axis=0)], axis=1)
            for name, o in outlines.items()
            if name != what and tops_m[name] >= height_m
        ]
        if what != BANK:
            occluders.append(np.stack([world.shore_m, np.roll(world.shore_m, -1, axis=0)], axis=1))
        segments = np.concatenate(occluders) if occluders else np.empty((0, 2, 2))
        if any(not _is_occluded(camera_m, target, segments) for target in targets[in_view]):
            return True
    return False


def _walk_round(outline: F64) -> F64:
    """Places along a closed outline, `OUTLINE_SPACING_M` apart and less, its corners among them."""
    places = []
    for corner, following in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        count = 1 + int(np.hypot(*(following - corner)) / OUTLINE_SPACING_M)
        places.append(corner + np.arange(count)[:, None] / count * (following - corner))
    return np.concatenate(places)


def _distance_to_thing_m(thing: Obstacle | Actor, poses: F64, hull_path: HullPath) -> F64:
    distance_m = np.full(len(hull_path.x_m), MAX_CLEARANCE_M)
    reach_m = (
        0.5 * float(np.hypot(thing.length_m, thing.width_m)) + float(np.hypot(*hull_path.core_m)) + MAX_CLEARANCE_M
    )
    near = np.flatnonzero(np.hypot(poses[:, 0] - hull_path.x_m, poses[:, 1] - hull_path.y_m) < reach_m)
    if not len(near):
        return distance_m
    rel = _transform_to_hull(poses[near, :2][:, None, :], hull_path, near)
    if is_round(thing):
        gap = _distance_to_core_m(rel, hull_path.core_m)[:, 0] - 0.5 * thing.width_m
    else:
        shape = build_outline(thing)
        turn = poses[near, 2] - hull_path.yaw_rad[near]
        cos, sin = np.cos(turn)[:, None], np.sin(turn)[:, None]
        corners = rel + np.stack(
            [cos * shape[:, 0] - sin * shape[:, 1], sin * shape[:, 0] + cos * shape[:, 1]], axis=-1
        )
        core_corners = np.broadcast_to(hull_path.core_m * CORNER_SIGNS, (len(near), *CORNER_SIGNS.shape))
        gap = np.minimum(
            _distance_to_core_m(corners, hull_path.core_m).min(axis=1),
            _distance_to_polygon_m(core_corners, corners).min(axis=1),
        )
    distance_m[near] = np.clip(gap - hull_path.hull.radius_m, 0.0, MAX_CLEARANCE_M)
    return distance_m


def _distance_to_bank_m(shore_m: F64, hull_path: HullPath) -> F64:
    distance_m = np.full(len(hull_path.x_m), MAX_CLEARANCE_M)
    ends_m = np.roll(shore_m, -1, axis=0)
    low, high = np.minimum(shore_m, ends_m), np.maximum(shore_m, ends_m)
    for first in range(0, len(distance_m), MOMENTS_PER_CHUNK):
        part = np.arange(first, min(first + MOMENTS_PER_CHUNK, len(distance_m)))
        place = np.column_stack([hull_path.x_m[part], hull_path.y_m[part]])
        reach_m = MAX_CLEARANCE_M + 1.0
        near = ((low < place.max(axis=0) + reach_m) & (high > place.min(axis=0) - reach_m)).all(axis=1)
        if not near.any():
            continue
        start = _transform_to_hull(shore_m[near][None], hull_path, part)
        end = _transform_to_hull(ends_m[near][None], hull_path, part)
        gap = _distance_to_core_m(start, hull_path.core_m).min(axis=1)
        for corner in hull_path.core_m * CORNER_SIGNS:
            gap = np.minimum(gap, _distance_to_segments_m(corner, start, end).min(axis=1))
        distance_m[part] = np.clip(gap - hull_path.hull.radius_m, 0.0, MAX_CLEARANCE_M)
    return distance_m


def _transform_to_hull(points: F64, hull_path: HullPath, part: NDArray[np.int_]) -> F64:
    """Map points `(n or 1, k, 2)` in the hull's frame at each moment, `(n, k, 2)`."""
    x = points[..., 0] - hull_path.x_m[part][:, None]
    y = points[..., 1] - hull_path.y_m[part][:, None]
    cos, sin = np.cos(hull_path.yaw_rad[part])[:, None], np.sin(hull_path.yaw_rad[part])[:, None]
    return np.stack([cos * x + sin * y, cos * y - sin * x], axis=-1)


def _distance_to_core_m(points: F64, core_m: F64) -> F64:
    """Distance of points `(..., 2)` to the rectangle about the origin; 0 inside."""
    outside = np.maximum(np.abs(points) - core_m, 0.0)
    return np.hypot(outside[..., 0], outside[..., 1])


def _distance_to_segments_m(point: F64, start: F64, end: F64) -> F64:
    """Distance of one point to segments `(..., 2)`."""
    leg, rel = end - start, point - start
    part = np.clip((rel * leg).sum(-1) / np.maximum((leg * leg).sum(-1), 1e-12), 0.0, 1.0)
    gap = rel - part[..., None] * leg
    return np.asarray(np.hypot(gap[..., 0], gap[..., 1]), np.float64)


def _distance_to_polygon_m(points: F64, corners: F64) -> F64:
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


def _find_nearest_on_edges(polygon_m: F64, point: F64) -> F64:
    leg = np.roll(polygon_m, -1, axis=0) - polygon_m
    rel = point - polygon_m
    part = np.clip((rel * leg).sum(-1) / np.maximum((leg * leg).sum(-1), 1e-12), 0.0, 1.0)
    at = polygon_m + part[:, None] * leg
    nearest: F64 = at[int(np.argmin(((at - point) ** 2).sum(axis=1)))]
    return nearest


def _is_occluded(camera_m: F64, target: F64, segments: Sequence[F64] | F64) -> bool:
    """Whether any segment `(n, 2, 2)` lies between the two. One just before the target does not count."""
    if not len(segments):
        return False
    occluders = np.asarray(segments)
    way, start, leg = target - camera_m, occluders[:, 0] - camera_m, occluders[:, 1] - occluders[:, 0]
    cross = way[0] * leg[:, 1] - way[1] * leg[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        progress = (start[:, 0] * leg[:, 1] - start[:, 1] * leg[:, 0]) / cross
        part = (start[:, 0] * way[1] - start[:, 1] * way[0]) / cross
    return bool(((progress > 0.0) & (progress < 0.98) & (part >= 0.0) & (part <= 1.0)).any())
