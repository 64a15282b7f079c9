"""What is known of the water around the boat: 100 x 100 cells of 0.2 m, unknown by default (checklist Q2). Pure.

The grid lies in the map's axes and is laid anew around the boat from the sights of the last seconds.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from paani import portable
from paani.config import CalibrationConfig, PlannerConfig
from paani_services.navigator.projection import F64, Lens, Rays, Station, lens_at, ranges_m, rays, together
from paani_services.navigator.sighting import EDGE_STEPS, FOOT_STEPS, Box, Foot, Sight

CELLS = 100  # Q2
CELL_M = 0.2  # Q2
FOOT_COLUMNS = 24
FOOT_DEEP_M = 1.5  # a thing is as deep as it is wide, but no deeper
CUT_FRAC = 0.99  # a box that reaches this low goes on below the picture
CUT_NEARER_M = 0.8
ROWS = 2.0 / 64.0  # two of the mask: how far its edge is off a box's
REST = Station(0.0, 0.0, 0.0, 0.0, 0.0)

Mask = NDArray[np.bool_]
Indices = NDArray[np.int64]
Polygon = tuple[tuple[float, float], ...]
Moving = frozenset[tuple[int, int]]  # boxes of what moves: the sight's stamp and the box's number in it
NOTHING_MOVES: Moving = frozenset()


class Camera(NamedTuple):
    """The calibrated camera, and the own hull in its picture as in `perception.ego_polygon`."""

    calibration: CalibrationConfig = CalibrationConfig()
    hull: Polygon = ()


UNCALIBRATED = Camera()


class Points(NamedTuple):
    """Points of the map, and the number of the picture that shows each [n]."""

    east_m: F64
    north_m: F64
    number: Indices


NO_POINTS = Points(np.empty(0), np.empty(0), np.empty(0, np.int64))


class Grid(NamedTuple):
    """Cells [north, east]. A cell is occupied, free, beside the boat where no picture shows it, or unknown.

    west_m, south_m: the corner. hidden: occupied, but last seen more than `occupied_s` ago.
    """

    west_m: float
    south_m: float
    occupied: Mask
    hidden: Mask
    free: Mask
    beside: Mask

    @property
    def unknown(self) -> Mask:
        """Nothing is known."""
        return ~(self.occupied | self.free | self.beside)


def lay(
    sights: tuple[Sight, ...],
    position_m: tuple[float, float],
    now_us: int,
    camera: Camera,
    config: PlannerConfig,
    moving: Moving = NOTHING_MOVES,
) -> Grid:
    """The grid around the boat. sights: oldest first. moving: what moves occupies no cell.

    Free: seen free within `free_s`; occupied: seen occupied within `occupied_s` (Q3), or within `hidden_s` and not seen
    free since. Occupied wins. Beside: what the picture does not show because it is too near, given that there is a
    picture: whoever arms the boat answers for it at the start, and what drifts in from astern no camera sees anyway.
    """
    west_m, south_m = ((math.floor(at_m / CELL_M) - CELLS // 2) * CELL_M for at_m in position_m)
    longest_us, free_us, occupied_us = (
        now_us - round(age_s * 1e6)
        for age_s in (max(config.occupied_s, config.hidden_s), config.free_s, config.occupied_s)
    )
    known = [sight for sight in sights if longest_us <= sight.at_us <= now_us]
    known = [sight for sight in known if len(sight.edge) == len(known[-1].edge)]
    free_of, occupied_of = (np.full(CELLS * CELLS, -1, np.int64) for _ in range(2))  # number of the last sight
    first_free = sum(sight.at_us < free_us for sight in known)
    first_occupied = sum(sight.at_us < occupied_us for sight in known)
    if known:
        free, occupied = _seen(known, first_free, camera, config, moving)
        for last, points in ((free_of, free), (occupied_of, occupied)):
            cells, inside = _cells(points, west_m, south_m)
            last[cells] = points.number[inside]
    not_since = (occupied_of >= free_of) & (occupied_of >= 0) & (config.hidden_s > 0.0)
    occupied_now = not_since | ((occupied_of >= first_occupied) & (occupied_of >= 0))
    free_now = (free_of >= first_free) & (free_of >= 0) & ~occupied_now
    shape = (CELLS, CELLS)
    grid = Grid(
        west_m,
        south_m,
        occupied=occupied_now.reshape(shape),
        hidden=(occupied_now & (occupied_of < first_occupied)).reshape(shape),
        free=free_now.reshape(shape),
        beside=np.zeros(shape, np.bool_),
    )
    if first_free == len(known):
        return grid
    reach_m = blind_reach_m(known[-1].aspect, camera, config)
    return grid._replace(beside=_within(grid, position_m, reach_m) & ~(grid.occupied | grid.free))


def blind_reach_m(aspect: float, camera: Camera, config: PlannerConfig) -> float:
    """How far from the boat the water begins that a picture shows, boat at rest; 0 if that is beyond `blind_m`."""
    lens = lens_at(REST, camera.calibration, aspect)
    u = np.array([0.0, 0.25, 0.5, 0.75, 1.0])
    given = rays(lens, u, hull_top(camera.hull, u))
    near_m = ranges_m(lens, given, config.max_range_m)
    if not np.isfinite(near_m).all():
        return 0.0
    east_m, north_m = lens.at_m[0] + near_m * given.east, lens.at_m[1] + near_m * given.north
    reach_m = float(np.sqrt(east_m * east_m + north_m * north_m).max()) + CELL_M
    return reach_m if reach_m <= config.blind_m else 0.0


def hull_top(hull: Polygon, u: F64) -> F64:
    """The highest edge of the own hull at each of these columns, 1 where there is none [n] in [0, 1]."""
    top = np.ones_like(u)
    for (x1, y1), (x2, y2) in zip(hull, (*hull[1:], *hull[:1]), strict=True):
        low, high = min(x1, x2), max(x1, x2)
        wide = high - low
        part = (u - x1) / (x2 - x1) if wide > 0.0 else np.zeros_like(u)
        top = np.where((u >= low) & (u <= high), np.minimum(top, y1 + part * (y2 - y1)), top)
    return top


def _seen(
    sights: list[Sight], first_free: int, camera: Camera, config: PlannerConfig, moving: Moving
) -> tuple[Points, Points]:
    """Points of the map that the pictures show free, and occupied; those of later ones come later.

    first_free: the first that is young enough to free a cell; of those before, which only say what is gone, every
    second column is enough.
    """
    lenses = [lens_at(sight.station, camera.calibration, sight.aspect) for sight in sights]
    lens = together(lenses)
    edge = np.frombuffer(b"".join(sight.edge for sight in sights), np.uint8).astype(np.float64) / EDGE_STEPS
    edge = edge.reshape(len(sights), -1)
    u = (np.arange(edge.shape[1]) + 0.5) / edge.shape[1]
    top = hull_top(camera.hull, u)
    near_m = ranges_m(lens, rays(lens, u, top), config.max_range_m)
    ends = rays(lens, u, np.minimum(edge, top))
    far_m = ranges_m(lens, ends, config.max_range_m)
    water = ends.fall > -portable.tan(math.radians(config.horizon_slack_deg))  # higher up there is none
    numbers = np.broadcast_to(np.arange(len(sights))[:, None], edge.shape)
    open_m = np.where(water, np.minimum(far_m, config.max_range_m), 0.0) - near_m
    open_m[:first_free, 1::2] = 0.0
    free = _points(lens, ends, near_m, np.ceil(open_m / CELL_M), numbers)
    deep = math.ceil(config.thickness_m / CELL_M) + 1
    boxes = [[box for k, box in enumerate(sight.boxes) if (sight.at_us, k) in moving] for sight in sights]
    stays = np.ones(edge.shape, np.bool_)
    for number, own in enumerate(boxes):
        for box in own:
            stays[number] &= ~_ends_at(box, u, edge[number])
    points = [_points(lens, ends, far_m, np.where(np.isfinite(far_m) & stays, deep, 0.0), numbers)]
    for number, (each, sight) in enumerate(zip(lenses, sights, strict=True)):
        points += [_foot(each, foot, number, camera, config) for foot in sight.feet if _stays(foot, boxes[number])]
    if len(points) == 1:
        return free, points[0]
    numbers = np.concatenate([each.number for each in points])
    order = np.argsort(numbers, kind="stable")
    east_m, north_m = (np.concatenate(axis) for axis in ([p.east_m for p in points], [p.north_m for p in points]))
    return free, Points(east_m[order], north_m[order], numbers[order])


def _ends_at(box: Box, u: F64, edge: F64) -> Mask:
    """Columns where it is this thing that ends the water: near its foot; a hull's lies as high as half its box."""
    left, top, right, low = (side / FOOT_STEPS for side in (box.left, box.top, box.right, box.low))
    wide = 1.0 / len(u)
    high = low - ROWS if box.is_small else 0.5 * (top + low)
    return np.asarray((u > left - wide) & (u < right + wide) & (edge >= high) & (edge <= low + ROWS))


def _stays(foot: Foot, moving: list[Box]) -> bool:
    """It belongs to none of these."""
    wide = FOOT_STEPS // 64  # a column of the mask
    return all(foot.low != box.low or foot.left < box.left - wide or foot.right > box.right + wide for box in moving)


def _foot(lens: Lens, foot: Foot, number: int, camera: Camera, config: PlannerConfig) -> Points:
    """Points on the water under a box: along its lower end, as far behind as it is wide; more round people."""
    left, right, low = (end / FOOT_STEPS for end in (foot.left, foot.right, foot.low))
    given, range_m = _along(lens, left, right, low, camera, config)
    if not np.isfinite(range_m).all():
        return NO_POINTS
    wide_m = _width_m(given, range_m)
    room_m = config.person_room_m if foot.person else 0.0
    if room_m > 0.0:
        more = (right - left) * room_m / max(wide_m, CELL_M)
        given, range_m = _along(lens, left - more, right + more, low, camera, config)
        if not np.isfinite(range_m).all():
            return NO_POINTS
    nearer_m = room_m + (CUT_NEARER_M if low >= CUT_FRAC else 0.0)
    deep = math.ceil((nearer_m + room_m + max(config.thickness_m, min(wide_m, FOOT_DEEP_M))) / CELL_M) + 1
    first_m = np.maximum(range_m - nearer_m, 0.0)
    return _points(lens, given, first_m, np.full(range_m.shape, float(deep)), np.full(range_m.shape, number))


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


def _points(lens: Lens, given: Rays, first_m: F64, counts: F64, numbers: Indices) -> Points:
    """So many places on each ray, a cell apart, from that far on; all arrays of the rays' shape."""
    times = np.maximum(counts, 0.0).astype(np.int64).ravel()
    ray = np.repeat(np.arange(times.size), times)
    place = np.arange(ray.size) - np.repeat(np.cumsum(times) - times, times)
    range_m = first_m.ravel()[ray] + CELL_M * place
    east_m, north_m = (np.broadcast_to(axis, first_m.shape).ravel()[ray] for axis in lens.at_m[:2])
    return Points(
        east_m + range_m * given.east.ravel()[ray], north_m + range_m * given.north.ravel()[ray], numbers.ravel()[ray]
    )


def _cells(points: Points, west_m: float, south_m: float) -> tuple[Indices, Mask]:
    """Indices of the cells that points lie in, and which of the points do lie in the grid."""
    column = np.floor((points.east_m - west_m) / CELL_M).astype(np.int64)
    row = np.floor((points.north_m - south_m) / CELL_M).astype(np.int64)
    inside = (column >= 0) & (column < CELLS) & (row >= 0) & (row < CELLS)
    return (row * CELLS + column)[inside], inside


def _within(grid: Grid, position_m: tuple[float, float], reach_m: float) -> Mask:
    """Cells whose middle lies within reach."""
    middle = (np.arange(CELLS) + 0.5) * CELL_M
    east_m, north_m = grid.west_m + middle - position_m[0], grid.south_m + middle - position_m[1]
    return np.asarray((east_m * east_m)[None, :] + (north_m * north_m)[:, None] <= reach_m * reach_m)
