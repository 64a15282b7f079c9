"""What one picture shows of the water: cells of the map that are free, and cells that are occupied. Pure.

A sight never changes, so each is worked out once.
"""

import functools
import math
from typing import NamedTuple

import msgspec
import numpy as np

from paani import portable
from paani.arrays import F64, I64, Bools
from paani.config import CalibrationConfig, PlannerConfig
from paani.messages import Label
from paani_services.navigator.mapping.observation import EDGE_STEPS, FOOT_STEPS, MASK_ROW, Box, Foot, Sight
from paani_services.navigator.mapping.projection import Lens, Rays, lens_at, ranges_m, rays

CELL_M = 0.2  # Q2
FOOT_COLUMNS = 24
FOOT_DEEP_M = 1.5  # a thing is as deep as it is wide, but no deeper
HULL_DEEP_M, HULL_LONG_M = 2.5, 6.0  # nor is a vessel: beam and length of most
CUT_FRAC = 0.99  # a box that reaches this low goes on below the picture
CUT_NEARER_M = 0.8
ROWS = 2.0 * MASK_ROW  # how far its edge is off a box's
SIGHTS_HELD = 512
WIDEST = 1 << 24  # columns of the map: 3,355 km

Polygon = tuple[tuple[float, float], ...]


class Camera(NamedTuple):
    """The calibrated camera, and the own hull in its picture as in `perception.ego_polygon`."""

    calibration: CalibrationConfig = CalibrationConfig()
    hull: Polygon = ()


class Cells(NamedTuple):
    """Cells of the map [n], each once; cell (0, 0) has its south-west corner in the map's origin."""

    column: I64
    row: I64


class Shown(NamedTuple):
    """What one picture shows; a cell may be both. people: where they are, without the room that is kept round them.

    vessels: occupied by one.
    """

    free: Cells
    occupied: Cells
    people: Cells
    vessels: Cells


@functools.lru_cache(maxsize=SIGHTS_HELD)
def shown(sight: Sight, moving: tuple[Box, ...], camera: Camera, config: PlannerConfig, *, every: int) -> Shown:
    """The cells of a sight with an edge. moving: its boxes that occupy nothing. every: columns from one taken for free
    water to the next.
    """
    lens = lens_at(sight.station, camera.calibration, sight.aspect)
    edge = np.frombuffer(sight.edge, np.uint8).astype(np.float64) / EDGE_STEPS
    u = (np.arange(edge.size) + 0.5) / edge.size
    top = hull_top(camera.hull, u)
    near_m = ranges_m(lens, rays(lens, u, top), config.max_range_m)
    ends = rays(lens, u, np.minimum(edge, top))
    far_m = ranges_m(lens, ends, config.max_range_m)
    water = ends.fall > -portable.tan(math.radians(config.horizon_slack_deg))  # higher up there is none
    open_m = np.where(water, np.minimum(far_m, config.max_range_m), 0.0) - near_m
    open_m[np.arange(edge.size) % every > 0] = 0.0
    gone = np.zeros(u.shape, np.bool_)
    for box in moving:
        gone |= _ends_at(box, u, edge)
    deep_m, is_hull = np.full(u.shape, config.thickness_m), np.zeros(u.shape, np.bool_)
    for box in sight.boxes:
        if box.label is Label.VESSEL and box not in moving:
            is_hull[_lay_hull(box, lens, u, ends, far_m, deep_m, config)] = True
    stays = np.isfinite(far_m) & ~gone
    deep = np.where(stays, np.ceil(deep_m / CELL_M) + 1.0, 0.0)
    points = [_points(lens, ends, far_m, deep)]
    points += [_foot(lens, foot, camera, config) for foot in sight.feet if _stays(foot, moving)]
    free = _points(lens, ends, near_m, np.ceil(open_m / CELL_M))
    alone = msgspec.structs.replace(config, person_room_m=0.0)
    people = [_foot(lens, foot, camera, alone) for foot in sight.feet if foot.person and _stays(foot, moving)]
    hulls = _points(lens, ends, far_m, np.where(is_hull, deep, 0.0))
    return Shown(_cells(*free), _joined(points), _joined(people), _cells(*hulls))


def _lay_hull(box: Box, lens: Lens, u: F64, ends: Rays, far_m: F64, deep_m: F64, config: PlannerConfig) -> I64:
    """Complete a vessel in `far_m`, and how deep each column is in `deep_m`: it hides what of it lies behind.

    Where the mask looks through part of it (a white bow is taken for water), that is as far away as the part beside
    it; where through all of it, the box's lower end counts. What stands before it is not part of it. The columns that
    are its own.
    """
    across = np.flatnonzero((u > box.left / FOOT_STEPS) & (u < box.right / FOOT_STEPS))
    low_m, least_m = (
        ranges_m(lens, rays(lens, u[across], np.full(across.shape, box.low / FOOT_STEPS + below)), config.max_range_m)
        for below in (0.0, ROWS)
    )
    if across.size == 0 or not np.isfinite(low_m).all():
        return across[:0]
    own = far_m[across] >= least_m
    seen = across[own & (far_m[across] <= low_m.min() + HULL_LONG_M)]
    beside_m = low_m if seen.size == 0 else far_m[seen[np.abs(across[:, None] - seen[None, :]).argmin(axis=1)]]
    far_m[across] = np.minimum(far_m[across], np.where(own, beside_m, np.inf))
    wide_m = _width_m(Rays(*(axis[across] for axis in ends)), far_m[across])
    deep_m[across] = np.maximum(deep_m[across], min(wide_m, HULL_DEEP_M))
    return across[own]


def hull_top(hull: Polygon, u: F64) -> F64:
    """The highest edge of the own hull at each of these columns, 1 where there is none [n] in [0, 1]."""
    top = np.ones_like(u)
    for (x1, y1), (x2, y2) in zip(hull, (*hull[1:], *hull[:1]), strict=True):
        low, high = min(x1, x2), max(x1, x2)
        wide = high - low
        part = (u - x1) / (x2 - x1) if wide > 0.0 else np.zeros_like(u)
        top = np.where((u >= low) & (u <= high), np.minimum(top, y1 + part * (y2 - y1)), top)
    return top


def _ends_at(box: Box, u: F64, edge: F64) -> Bools:
    """Columns where it is this thing that ends the water: near its foot; a hull's lies as high as half its box."""
    left, top, right, low = (side / FOOT_STEPS for side in (box.left, box.top, box.right, box.low))
    wide = 1.0 / len(u)
    high = low - ROWS if box.is_small else 0.5 * (top + low)
    return np.asarray((u > left - wide) & (u < right + wide) & (edge >= high) & (edge <= low + ROWS))


def _stays(foot: Foot, moving: tuple[Box, ...]) -> bool:
    """It belongs to none of these."""
    wide = FOOT_STEPS // 64  # a column of the mask
    return all(foot.low != box.low or foot.left < box.left - wide or foot.right > box.right + wide for box in moving)


def _foot(lens: Lens, foot: Foot, camera: Camera, config: PlannerConfig) -> tuple[F64, F64]:
    """Points on the water under a box: along its lower end, as far behind as it is wide; more round people."""
    left, right, low = (end / FOOT_STEPS for end in (foot.left, foot.right, foot.low))
    given, range_m = _along(lens, left, right, low, camera, config)
    if not np.isfinite(range_m).all():
        return np.empty(0), np.empty(0)
    wide_m = _width_m(given, range_m)
    room_m = config.person_room_m if foot.person else 0.0
    if room_m > 0.0:
        more = (right - left) * room_m / max(wide_m, CELL_M)
        given, range_m = _along(lens, left - more, right + more, low, camera, config)
        if not np.isfinite(range_m).all():
            return np.empty(0), np.empty(0)
    nearer_m = room_m + (CUT_NEARER_M if low >= CUT_FRAC else 0.0)
    deep = math.ceil((nearer_m + room_m + max(config.thickness_m, min(wide_m, FOOT_DEEP_M))) / CELL_M) + 1
    return _points(lens, given, np.maximum(range_m - nearer_m, 0.0), np.full(range_m.shape, float(deep)))


def _along(
    lens: Lens, left: float, right: float, low: float, camera: Camera, config: PlannerConfig
) -> tuple[Rays, F64]:
    """Rays through the lower end of a box, and how far along each the water lies."""
    u = left + (right - left) * (np.arange(FOOT_COLUMNS) + 0.5) / FOOT_COLUMNS
    given = rays(lens, u, np.minimum(low, hull_top(camera.hull, u)))
    return given, ranges_m(lens, given, config.max_range_m)


def _width_m(given: Rays, range_m: F64) -> float:
    east_m, north_m = range_m * given.east, range_m * given.north
    return math.hypot(float(east_m[-1] - east_m[0]), float(north_m[-1] - north_m[0]))


def _points(lens: Lens, given: Rays, first_m: F64, counts: F64) -> tuple[F64, F64]:
    """East and north of so many places on each ray, a cell apart, from that far on; all arrays of the rays' shape."""
    times = np.maximum(counts, 0.0).astype(np.int64)
    ray = np.repeat(np.arange(times.size), times)
    place = np.arange(ray.size) - np.repeat(np.cumsum(times) - times, times)
    range_m = first_m[ray] + CELL_M * place
    return lens.at_m[0] + range_m * given.east[ray], lens.at_m[1] + range_m * given.north[ray]


def _joined(points: list[tuple[F64, F64]]) -> Cells:
    east_m, north_m = zip(*points, strict=True) if points else ((), ())
    return _cells(np.concatenate([np.empty(0), *east_m]), np.concatenate([np.empty(0), *north_m]))


def _cells(east_m: F64, north_m: F64) -> Cells:
    column, row = (np.floor(axis / CELL_M).astype(np.int64) for axis in (east_m, north_m))
    each_once = np.unique(row * WIDEST + column)
    row = (each_once + WIDEST // 2) // WIDEST
    return Cells(each_once - row * WIDEST, row)
