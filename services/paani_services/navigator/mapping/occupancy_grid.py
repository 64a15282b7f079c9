"""Occupancy grid of the water around the boat: 100 x 100 cells of 0.2 m, unknown by default (Q2). Pure.

The grid has the map's axes and is built anew around the boat from the observations of the last seconds.
"""

import math
from typing import NamedTuple

import numpy as np

from paani.arrays import F64, I64, Bools
from paani.config import PlannerConfig
from paani_services.navigator.mapping.distance_field import distance_field_m
from paani_services.navigator.mapping.observation import Observation
from paani_services.navigator.mapping.observed_cells import (
    CELL_M,
    Camera,
    CellIndices,
    ObservedCells,
    own_hull_top,
    project_to_cells,
)
from paani_services.navigator.mapping.projection import Pose, pinhole_at, pixel_rays, ranges_to_water_m

GRID_CELLS = 100  # cells along each side of the grid (Q2)
LEVEL_POSE = Pose(0.0, 0.0, 0.0, 0.0, 0.0)
OLD_COLUMN_STEP = 2  # every second column of a picture that is too old to free cells, and only shows what has gone

BoxIds = frozenset[tuple[int, int]]  # of boxes: the observation's stamp, and the box's number in it
NO_BOXES: BoxIds = frozenset()
UNCALIBRATED_CAMERA = Camera()


class OccupancyGrid(NamedTuple):
    """The grid [north, east]. A cell is occupied, free, in the blind zone beside the boat, or unknown.

    west_m, south_m: the corner of the grid.
    occluded: occupied, but last seen more than `occupied_s` ago.
    people: occupied by a person, without the room kept around them.
    reachable_unseen: a person or a vessel out of sight may have got there, and no picture shows water there now.
    possible_people: a person is there, or out of sight may have got there.
    """

    west_m: float
    south_m: float
    occupied: Bools
    occluded: Bools
    free: Bools
    blind_zone: Bools
    people: Bools
    reachable_unseen: Bools
    possible_people: Bools

    @property
    def is_recent(self) -> bool:
        """Whether a picture of the last `free_s` shows the water, or all of it is in the blind zone."""
        return bool((self.free | self.blind_zone).any())

    @property
    def unknown(self) -> Bools:
        """Nothing is known of the cell."""
        return ~(self.occupied | self.free | self.blind_zone)

    def with_occupied(self, cells: Bools) -> "OccupancyGrid":
        """The grid with these cells occupied, whatever else they were taken for."""
        return self._replace(
            occupied=self.occupied | cells, free=self.free & ~cells, blind_zone=self.blind_zone & ~cells
        )

    def locate(self, east_m: F64, north_m: F64) -> tuple[I64, I64, Bools]:
        """Row and column of the cell of each place, and whether that is on the grid [places]."""
        column = np.floor((east_m - self.west_m) / CELL_M).astype(np.int64)
        row = np.floor((north_m - self.south_m) / CELL_M).astype(np.int64)
        return row, column, (column >= 0) & (column < GRID_CELLS) & (row >= 0) & (row < GRID_CELLS)


def build_occupancy_grid(
    observations: tuple[Observation, ...],
    position_m: tuple[float, float],
    now_us: int,
    camera: Camera,
    config: PlannerConfig,
    moving_boxes: BoxIds = NO_BOXES,
) -> OccupancyGrid:
    """Build the grid around the boat from remembered observations, oldest first.

    It is not a Bayesian grid (Thrun, Burgard, Fox: "Probabilistic Robotics", 2005, chapter 9): a cell is what it was
    last seen to be, for a lifetime.
      * Occupied: seen occupied within `occupied_s` (Q3), or within `hidden_s` and not seen free since.
      * Free: seen free within `free_s` (Q3), and not occupied.
      * Occupied wins, except for what one picture alone shows and `outvoted_by` later ones show free: a glint.
      * Blind zone: nearer than the camera sees, as long as there is a picture. Whoever arms the boat answers for it at
        the start, and no camera sees what drifts in from astern.
    Boxes of dynamic obstacles (`moving_boxes`) occupy no cell.
    """
    west, south = (math.floor(at_m / CELL_M) - GRID_CELLS // 2 for at_m in position_m)
    longest_us, free_us, occupied_us = (
        now_us - round(age_s * 1e6)
        for age_s in (max(config.occupied_s, config.hidden_s), config.free_s, config.occupied_s)
    )
    recent = [observation for observation in observations if longest_us <= observation.stamp_us <= now_us]
    recent = [observation for observation in recent if len(observation.water_edge) == len(recent[-1].water_edge)]
    first_free = sum(observation.stamp_us < free_us for observation in recent)
    first_occupied = sum(observation.stamp_us < occupied_us for observation in recent)
    pictures = []
    for number, observation in enumerate(recent):
        boxes = tuple(box for k, box in enumerate(observation.boxes) if (observation.stamp_us, k) in moving_boxes)
        pictures.append(
            project_to_cells(
                observation, boxes, camera, config, column_step=OLD_COLUMN_STEP if number < first_free else 1
            )
        )
    last_free = _last_observed([picture.free for picture in pictures], west, south)
    last_occupied = _last_observed([picture.occupied for picture in pictures], west, south)
    not_freed_since = (last_occupied >= last_free) & (last_occupied >= 0) & (config.hidden_s > 0.0)
    occupied_now = not_freed_since | ((last_occupied >= first_occupied) & (last_occupied >= 0))
    if config.outvoted_by > 0:
        occupied_now &= ~_is_outvoted(pictures[first_occupied:], last_occupied - first_occupied, west, south, config)
    last_person = _last_observed([picture.people for picture in pictures], west, south)
    last_vessel = _last_observed([picture.vessels for picture in pictures], west, south)
    people_now, vessels_now = (
        occupied_now & (last_of >= 0) & ((last_of >= last_free) | (last_of >= first_occupied))
        for last_of in (last_person, last_vessel)
    )
    free_now = (last_free >= first_free) & (last_free >= 0) & ~occupied_now
    ages_s = np.zeros(len(recent) + 1)  # zero for what is in sight now and, in the last place, for what never was
    ages_s[:first_occupied] = [(now_us - observation.stamp_us) * 1e-6 for observation in recent[:first_occupied]]
    swum_m = np.minimum(config.person_mps * ages_s, config.person_reach_m)
    drifted_m = np.minimum(config.drift_mps * ages_s, config.vessel_reach_m)
    shape = (GRID_CELLS, GRID_CELLS)
    is_shown = free_now.reshape(shape)
    swum, drifted = _dilate(people_now, swum_m[last_person]), _dilate(vessels_now, drifted_m[last_vessel])
    grid = OccupancyGrid(
        west * CELL_M,
        south * CELL_M,
        occupied=occupied_now.reshape(shape),
        occluded=(occupied_now & (last_occupied < first_occupied)).reshape(shape),
        free=is_shown,
        blind_zone=np.zeros(shape, np.bool_),
        people=people_now.reshape(shape),
        possible_people=people_now.reshape(shape) | (swum & ~is_shown),
        reachable_unseen=(swum | drifted) & ~is_shown,
    )
    if first_free == len(recent):
        return grid
    reach_m = blind_zone_radius_m(recent[-1].aspect_ratio, camera, config)
    return grid._replace(blind_zone=_cells_within(grid, position_m, reach_m) & ~(grid.occupied | grid.free))


def blind_zone_radius_m(aspect: float, camera: Camera, config: PlannerConfig) -> float:
    """Distance from a level boat beyond which its camera sees all water ahead; 0 if that is beyond `blind_m`."""
    camera_model = pinhole_at(LEVEL_POSE, camera.calibration, aspect)
    u = np.array([0.0, 0.25, 0.5, 0.75, 1.0])
    rays = pixel_rays(camera_model, u, own_hull_top(camera.ego_polygon, u))
    near_m = ranges_to_water_m(camera_model, rays, config.max_range_m)
    if not np.isfinite(near_m).all():
        return 0.0
    east_m, north_m = (
        camera_model.position_m[0] + near_m * rays.east,
        camera_model.position_m[1] + near_m * rays.north,
    )
    reach_m = float(np.sqrt(east_m * east_m + north_m * north_m).max()) + CELL_M
    return reach_m if reach_m <= config.blind_m else 0.0


def _dilate(cells: Bools, reach_m: F64) -> Bools:
    """Cells that lie within the reach of the given cells, each cell with a reach of its own [100 * 100]; [100, 100]."""
    found = np.zeros((GRID_CELLS, GRID_CELLS), np.bool_)
    steps = np.ceil(reach_m / CELL_M) * cells
    for reach in np.unique(steps[steps > 0.0]):
        found |= distance_field_m((steps == reach).reshape(found.shape)) <= reach * CELL_M
    return found


def _is_outvoted(
    pictures: list[ObservedCells], last_occupied: I64, west: int, south: int, config: PlannerConfig
) -> Bools:
    """Cells that one picture alone shows occupied, with all cells around them, and that enough later ones show free.

    last_occupied: the number of the last picture that shows each cell occupied.
    """
    number, cell = _all_observed([picture.occupied for picture in pictures], west, south)
    first = np.full(GRID_CELLS * GRID_CELLS, len(pictures), np.int64)
    first[cell[::-1]] = number[::-1]
    earliest = _extreme_of_neighbours(first.reshape(GRID_CELLS, GRID_CELLS), np.minimum)
    latest = _extreme_of_neighbours(last_occupied.reshape(GRID_CELLS, GRID_CELLS), np.maximum)
    number, cell = _all_observed([picture.free for picture in pictures], west, south)
    free_votes = np.bincount(cell[number > last_occupied[cell]], minlength=GRID_CELLS * GRID_CELLS)
    return np.asarray((earliest == latest).ravel() & (free_votes >= config.outvoted_by))


def _extreme_of_neighbours(values: I64, extreme: np.ufunc) -> I64:
    """The smallest or largest value of each cell and the eight around it."""
    for _ in range(2):
        found = values.copy()
        extreme(found[1:], values[:-1], out=found[1:])
        extreme(found[:-1], values[1:], out=found[:-1])
        values = found.T
    return values


def _last_observed(pictures: list[CellIndices], west: int, south: int) -> I64:
    """The number of the last picture that shows each cell of the grid, -1 where none does [100 * 100]."""
    last = np.full(GRID_CELLS * GRID_CELLS, -1, np.int64)
    number, cell = _all_observed(pictures, west, south)
    last[cell] = number
    return last


def _all_observed(pictures: list[CellIndices], west: int, south: int) -> tuple[I64, I64]:
    """Every cell of the grid that each picture shows: the picture's number, rising, and the cell's."""
    if not pictures:
        return np.empty(0, np.int64), np.empty(0, np.int64)
    number = np.repeat(np.arange(len(pictures)), [picture.column.size for picture in pictures])
    column = np.concatenate([picture.column for picture in pictures]) - west
    row = np.concatenate([picture.row for picture in pictures]) - south
    inside = (column >= 0) & (column < GRID_CELLS) & (row >= 0) & (row < GRID_CELLS)
    return number[inside], (row * GRID_CELLS + column)[inside]


def _cells_within(grid: OccupancyGrid, position_m: tuple[float, float], reach_m: float) -> Bools:
    """Cells whose middle lies within reach of the position."""
    middle = (np.arange(GRID_CELLS) + 0.5) * CELL_M
    east_m, north_m = grid.west_m + middle - position_m[0], grid.south_m + middle - position_m[1]
    return np.asarray((east_m * east_m)[None, :] + (north_m * north_m)[:, None] <= reach_m * reach_m)
