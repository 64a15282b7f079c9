"""Projection of one observation to free and occupied cells of the map. Pure.

An observation never changes, so each is projected once and cached.
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
from paani_services.navigator.mapping.observation import (
    BOX_STEPS,
    EDGE_STEPS,
    MASK_ROW_FRAC,
    FootLine,
    Observation,
    ObstacleBox,
)
from paani_services.navigator.mapping.projection import PinholeCamera, Rays, pinhole_at, pixel_rays, ranges_to_water_m

CELL_M = 0.2  # side of a cell [m] (Q2)
FOOT_SAMPLES = 24  # rays through the lower end of a box
MAX_FOOT_DEPTH_M = 1.5  # a small obstacle is taken to be as deep as it is wide, up to this
MAX_HULL_DEPTH_M, MAX_HULL_LENGTH_M = 2.5, 6.0  # a vessel too: beam and length of most small craft
CUT_OFF_FRAC = 0.99  # of the picture's height; a box that reaches this low goes on below the picture
CUT_OFF_ALLOWANCE_M = 0.8  # how much nearer than the picture shows such an obstacle is taken to stand
BOX_EDGE_TOLERANCE_FRAC = 2.0 * MASK_ROW_FRAC  # difference between the mask's edge and a box's, of the picture's height
CACHED_OBSERVATIONS = 64  # more than are in use; the cells of others are megabytes that come and go with what is seen
MAP_COLUMNS = 1 << 24  # of cells in the map: 3,355 km

Polygon = tuple[tuple[float, float], ...]


class Camera(NamedTuple):
    """The calibrated camera, and the own hull in its picture (`perception.ego_polygon`)."""

    calibration: CalibrationConfig = CalibrationConfig()
    ego_polygon: Polygon = ()


class CellIndices(NamedTuple):
    """Cells of the map [n], each once; cell (0, 0) has its south-west corner at the map's origin."""

    column: I64
    row: I64


NO_CELLS = CellIndices(np.empty(0, np.int64), np.empty(0, np.int64))


class ObservedCells(NamedTuple):
    """The cells that one picture shows; a cell may be free and occupied at once.

    people: cells where people are, without the room kept around them. vessels: cells occupied by one.
    """

    free: CellIndices
    occupied: CellIndices
    people: CellIndices
    vessels: CellIndices


class WaterEdge(NamedTuple):
    """The water edge of one picture, by columns: where it ends in the picture, the rays there, and how far those are.

    free: the cells of the water before it.
    """

    camera_model: PinholeCamera
    u: F64
    v: F64
    rays: Rays
    range_m: F64
    free: CellIndices


class FootPoints(NamedTuple):
    """Points on the water that one obstacle covers, and those that a person does without the room kept around them."""

    foot: FootLine
    points: tuple[F64, F64]
    person_points: tuple[F64, F64] | None


@functools.lru_cache(maxsize=CACHED_OBSERVATIONS)
def project_to_cells(
    observation: Observation,
    moving_boxes: tuple[ObstacleBox, ...],
    camera: Camera,
    config: PlannerConfig,
    *,
    column_step: int,
) -> ObservedCells:
    """Project an observation with a water edge to cells of the map.

    Each column of the mask frees the cells up to where its water ends, and occupies those beyond as deep as the
    obstacle is taken to be. `moving_boxes` are those of dynamic obstacles, which occupy nothing. Only every
    `column_step`th column frees cells.
    """
    edge = _project_water_edge(observation, camera, config, column_step)
    u, far_m = edge.u, edge.range_m.copy()
    is_moving = np.zeros(u.shape, np.bool_)
    for box in moving_boxes:
        is_moving |= _is_water_ended_by(box, u, edge.v)
    depth_m, is_hull = np.full(u.shape, config.thickness_m), np.zeros(u.shape, np.bool_)
    for box in observation.boxes:
        if box.label is Label.VESSEL and box not in moving_boxes:
            is_hull[_complete_hull(box, edge.camera_model, u, edge.rays, far_m, depth_m, config)] = True
    is_static = np.isfinite(far_m) & ~is_moving
    depth = np.where(is_static, np.ceil(depth_m / CELL_M) + 1.0, 0.0)
    feet = [each for each in _project_feet(observation, camera, config) if _is_static(each.foot, moving_boxes)]
    points = [_points_along_rays(edge.camera_model, edge.rays, far_m, depth), *(each.points for each in feet)]
    people = [each.person_points for each in feet if each.person_points is not None]
    hulls = _points_along_rays(edge.camera_model, edge.rays, far_m, np.where(is_hull, depth, 0.0))
    return ObservedCells(edge.free, _cells_of_all(points), _cells_of_all(people), _cells_at(*hulls))


@functools.lru_cache(maxsize=CACHED_OBSERVATIONS)
def _project_water_edge(observation: Observation, camera: Camera, config: PlannerConfig, column_step: int) -> WaterEdge:
    """Project what does not depend on which obstacles move, which changes from picture to picture."""
    camera_model = pinhole_at(observation.pose, camera.calibration, observation.aspect_ratio)
    v = np.frombuffer(observation.water_edge, np.uint8).astype(np.float64) / EDGE_STEPS
    u = (np.arange(v.size) + 0.5) / v.size
    top = own_hull_top(camera.ego_polygon, u)
    near_m = ranges_to_water_m(camera_model, pixel_rays(camera_model, u, top), config.max_range_m)
    rays = pixel_rays(camera_model, u, np.minimum(v, top))
    far_m = ranges_to_water_m(camera_model, rays, config.max_range_m)
    is_water = rays.descent > -portable.tan(math.radians(config.horizon_slack_deg))  # no water is seen higher up
    open_m = np.where(is_water, np.minimum(far_m, config.max_range_m), 0.0) - near_m
    open_m[np.arange(v.size) % column_step > 0] = 0.0
    free = _points_along_rays(camera_model, rays, near_m, np.ceil(open_m / CELL_M))
    return WaterEdge(camera_model, u, v, rays, far_m, _cells_at(*free))


@functools.lru_cache(maxsize=CACHED_OBSERVATIONS)
def _project_feet(observation: Observation, camera: Camera, config: PlannerConfig) -> tuple[FootPoints, ...]:
    camera_model = pinhole_at(observation.pose, camera.calibration, observation.aspect_ratio)
    without_room = msgspec.structs.replace(config, person_room_m=0.0)
    return tuple(
        FootPoints(
            foot,
            _foot_points(camera_model, foot, camera, config),
            _foot_points(camera_model, foot, camera, without_room) if foot.is_person else None,
        )
        for foot in observation.feet
    )


def _complete_hull(
    box: ObstacleBox, camera_model: PinholeCamera, u: F64, ends: Rays, far_m: F64, depth_m: F64, config: PlannerConfig
) -> I64:
    """Complete a vessel in `far_m` and its depth in `depth_m`; return the columns that are its own.

    A hull hides its far side, so it is taken to be as deep as it is wide. Where the mask misses part of it, as a white
    bow taken for water, that part is as far away as the part beside it; where the mask misses all of it, the lower end
    of the box counts. What stands before the hull is not part of it.
    """
    columns = np.flatnonzero((u > box.left / BOX_STEPS) & (u < box.right / BOX_STEPS))
    bottom_m, least_m = (
        ranges_to_water_m(
            camera_model,
            pixel_rays(camera_model, u[columns], np.full(columns.shape, box.bottom / BOX_STEPS + below)),
            config.max_range_m,
        )
        for below in (0.0, BOX_EDGE_TOLERANCE_FRAC)
    )
    if columns.size == 0 or not np.isfinite(bottom_m).all():
        return columns[:0]
    is_own = far_m[columns] >= least_m
    visible = columns[is_own & (far_m[columns] <= bottom_m.min() + MAX_HULL_LENGTH_M)]
    beside_m = (
        bottom_m if visible.size == 0 else far_m[visible[np.abs(columns[:, None] - visible[None, :]).argmin(axis=1)]]
    )
    far_m[columns] = np.minimum(far_m[columns], np.where(is_own, beside_m, np.inf))
    width_m = _width_m(Rays(*(axis[columns] for axis in ends)), far_m[columns])
    depth_m[columns] = np.maximum(depth_m[columns], min(width_m, MAX_HULL_DEPTH_M))
    return columns[is_own]


def own_hull_top(ego_polygon: Polygon, u: F64) -> F64:
    """The highest edge of the own hull in each of these columns, 1 where there is none [n] in [0, 1]."""
    top = np.ones_like(u)
    for (x1, y1), (x2, y2) in zip(ego_polygon, (*ego_polygon[1:], *ego_polygon[:1]), strict=True):
        bottom, high = min(x1, x2), max(x1, x2)
        width = high - bottom
        part = (u - x1) / (x2 - x1) if width > 0.0 else np.zeros_like(u)
        top = np.where((u >= bottom) & (u <= high), np.minimum(top, y1 + part * (y2 - y1)), top)
    return top


def _is_water_ended_by(box: ObstacleBox, u: F64, edge: F64) -> Bools:
    """Whether it is this obstacle that ends the water in each column [n].

    Then the water ends near its foot, or for a hull in the lower half of its box.
    """
    left, top, right, bottom = (side / BOX_STEPS for side in (box.left, box.top, box.right, box.bottom))
    width = 1.0 / len(u)
    high = bottom - BOX_EDGE_TOLERANCE_FRAC if box.is_small else 0.5 * (top + bottom)
    return np.asarray(
        (u > left - width) & (u < right + width) & (edge >= high) & (edge <= bottom + BOX_EDGE_TOLERANCE_FRAC)
    )


def _is_static(foot: FootLine, moving_boxes: tuple[ObstacleBox, ...]) -> bool:
    """Whether the foot belongs to none of these boxes."""
    width = BOX_STEPS // 64  # a column of the mask
    return all(
        foot.bottom != box.bottom or foot.left < box.left - width or foot.right > box.right + width
        for box in moving_boxes
    )


def _foot_points(camera_model: PinholeCamera, foot: FootLine, camera: Camera, config: PlannerConfig) -> tuple[F64, F64]:
    """Points on the water that an obstacle covers: along its foot, as deep as it is wide, with more around people."""
    left, right, bottom = (end / BOX_STEPS for end in (foot.left, foot.right, foot.bottom))
    rays, range_m = _foot_rays(camera_model, left, right, bottom, camera, config)
    if not np.isfinite(range_m).all():
        return np.empty(0), np.empty(0)
    width_m = _width_m(rays, range_m)
    margin_m = config.person_room_m if foot.is_person else 0.0
    if margin_m > 0.0:
        widening = (right - left) * margin_m / max(width_m, CELL_M)
        rays, range_m = _foot_rays(camera_model, left - widening, right + widening, bottom, camera, config)
        if not np.isfinite(range_m).all():
            return np.empty(0), np.empty(0)
    allowance_m = margin_m + (CUT_OFF_ALLOWANCE_M if bottom >= CUT_OFF_FRAC else 0.0)
    depth = math.ceil((allowance_m + margin_m + max(config.thickness_m, min(width_m, MAX_FOOT_DEPTH_M))) / CELL_M) + 1
    return _points_along_rays(
        camera_model, rays, np.maximum(range_m - allowance_m, 0.0), np.full(range_m.shape, float(depth))
    )


def _foot_rays(
    camera_model: PinholeCamera, left: float, right: float, bottom: float, camera: Camera, config: PlannerConfig
) -> tuple[Rays, F64]:
    """Rays through the lower end of a box, and the distance along each to the water."""
    u = left + (right - left) * (np.arange(FOOT_SAMPLES) + 0.5) / FOOT_SAMPLES
    rays = pixel_rays(camera_model, u, np.minimum(bottom, own_hull_top(camera.ego_polygon, u)))
    return rays, ranges_to_water_m(camera_model, rays, config.max_range_m)


def _width_m(rays: Rays, range_m: F64) -> float:
    """Distance between the first and the last point."""
    east_m, north_m = range_m * rays.east, range_m * rays.north
    return math.hypot(float(east_m[-1] - east_m[0]), float(north_m[-1] - north_m[0]))


def _points_along_rays(camera_model: PinholeCamera, rays: Rays, first_m: F64, counts: F64) -> tuple[F64, F64]:
    """East and north of `counts` points on each ray, a cell apart, beginning at `first_m`."""
    times = np.maximum(counts, 0.0).astype(np.int64)
    ray = np.repeat(np.arange(times.size), times)
    place = np.arange(ray.size) - np.repeat(np.cumsum(times) - times, times)
    range_m = first_m[ray] + CELL_M * place
    return camera_model.position_m[0] + range_m * rays.east[ray], camera_model.position_m[1] + range_m * rays.north[ray]


def _cells_of_all(points: list[tuple[F64, F64]]) -> CellIndices:
    """The cells of all these points, each once."""
    east_m, north_m = zip(*points, strict=True) if points else ((), ())
    return _cells_at(np.concatenate([np.empty(0), *east_m]), np.concatenate([np.empty(0), *north_m]))


def _cells_at(east_m: F64, north_m: F64) -> CellIndices:
    """The cells of points, each once."""
    if east_m.size == 0:
        return NO_CELLS
    column, row = (np.floor(axis / CELL_M).astype(np.int64) for axis in (east_m, north_m))
    each_once = np.unique(row * MAP_COLUMNS + column)
    row = (each_once + MAP_COLUMNS // 2) // MAP_COLUMNS
    return CellIndices(each_once - row * MAP_COLUMNS, row)
