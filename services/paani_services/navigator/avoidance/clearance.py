"""Clearance of trajectories to the static cells of the grid and to predicted dynamic obstacles. Pure.

Static clearance is read from a signed distance field of the grid. A dynamic obstacle is predicted with constant
velocity and grows with the uncertainty of that velocity.
"""

from collections.abc import Sequence
from typing import NamedTuple, Self

import msgspec
import numpy as np

from paani import portable
from paani.arrays import F64, Bools
from paani.config import PlannerConfig
from paani_services.navigator.avoidance.rollout import BoatState, Trajectories
from paani_services.navigator.mapping.distance_field import signed_distance_field_m
from paani_services.navigator.mapping.dynamic_obstacles import DynamicObstacle
from paani_services.navigator.mapping.observed_cells import CELL_M
from paani_services.navigator.mapping.occupancy_grid import GRID_CELLS, OccupancyGrid

# Growth of an obstacle's position uncertainty per second out of sight [m/s], for changes of course and speed; measured:
# 1.2 m in 12 s.
UNSEEN_GROWTH_MPS = 0.1
# How far ahead an approach is predicted [s]: a boat needs 20 s to turn away from an obstacle that comes at 0.13 m/s.
APPROACH_S = 30.0
WANTED_CPA_M = 3.5  # what swimmers and paddlers want between hulls, 3 m, and half a hull
UNDER_WAY_MPS = (0.1, 0.2)  # slower for certain: adrift; faster for certain: under way
SWIMMING_MPS = 1.75  # nobody swims faster for long: the record over 1,500 m is 1.73 m/s
ESCAPE_GAIN_M = 0.1  # clearance that a way out must gain [m]: half a cell


class DynamicClearance(NamedTuple):
    """Clearance to the predicted outline of each of some dynamic obstacles.

    candidates_m: along each candidate [obstacles, times, candidates]. coasting_m: of the boat with its thrusters off
    [obstacles, times]. resting_m: the smallest so far, within the horizon, of a boat that stays where it is [obstacles,
    times].
    """

    candidates_m: F64
    coasting_m: F64
    resting_m: F64

    def of(self, which: Bools) -> Self:
        """Those of some of the obstacles [obstacles]."""
        return type(self)(*(each[which] for each in self))


class Approach(NamedTuple):
    """The approach of an obstacle's outline to a boat's middle: distance now, and distance and time of its CPA."""

    now_m: float
    cpa_m: float
    tcpa_s: float


def clearance_fields_m(grid: OccupancyGrid, config: PlannerConfig) -> tuple[F64, F64]:
    """Signed distance from the middle of each cell to the nearest static obstacle, at most 4 m [100, 100].

    It is negative inside an obstacle. Occluded cells are taken to have drifted nearer by `hidden_drift_m`. In the first
    field cells that a person or a vessel out of sight may have reached count as occupied, in the second they do not.
    """
    occluded_m = signed_distance_field_m(grid.occluded) - config.hidden_drift_m
    seen_m = np.minimum(signed_distance_field_m(grid.occupied), occluded_m)
    if not grid.reachable_unseen.any():
        return seen_m, seen_m
    return np.minimum(seen_m, signed_distance_field_m(grid.reachable_unseen)), seen_m


def interpolate_fields(grid: OccupancyGrid, fields: Sequence[F64], trajectories: Trajectories) -> list[F64]:
    """Interpolate each field bilinearly at each position; positions off the grid get the value at its border."""
    column = np.clip((trajectories.x_m - grid.west_m) / CELL_M - 0.5, 0.0, GRID_CELLS - 1.001)
    row = np.clip((trajectories.y_m - grid.south_m) / CELL_M - 0.5, 0.0, GRID_CELLS - 1.001)
    left, low = np.floor(column), np.floor(row)
    right_part, high_part = column - left, row - low
    left_part, low_part = 1.0 - right_part, 1.0 - high_part
    at = low.astype(np.int64) * GRID_CELLS + left.astype(np.int64)
    found = []
    for flat in (field.ravel() for field in fields):
        lower = flat[at] * left_part + flat[at + 1] * right_part
        upper = flat[at + GRID_CELLS] * left_part + flat[at + GRID_CELLS + 1] * right_part
        found.append(np.asarray(lower * low_part + upper * high_part))
    return found


def predicted_clearance_m(obstacle: DynamicObstacle, x_m: F64, y_m: F64, time_s: F64) -> F64:
    """Distance from positions to the predicted outline of an obstacle at these times, less the room kept around it.

    The outline moves with constant velocity. It grows by one standard deviation of that velocity, counted from when
    the obstacle was last seen, and by `UNSEEN_GROWTH_MPS` for the time out of sight.
    """
    velocity = obstacle.velocity
    east_m, north_m = x_m - time_s * velocity.east_mps, y_m - time_s * velocity.north_mps
    square, east, north = np.full(east_m.shape, np.inf), np.empty_like(east_m), np.empty_like(north_m)
    for x, y in zip(obstacle.east_m.tolist(), obstacle.north_m.tolist(), strict=True):
        np.square(np.subtract(east_m, x, out=east), out=east)
        np.square(np.subtract(north_m, y, out=north), out=north)
        np.minimum(square, np.add(east, north, out=east), out=square)
    return np.asarray(np.sqrt(square) - obstacle.standoff_m - position_deviation_m(obstacle, time_s))


def predict_clearances(
    obstacles: Sequence[DynamicObstacle], paths: Trajectories, config: PlannerConfig
) -> DynamicClearance:
    """The clearances to the obstacles along paths of which the last two are a boat's that coasts, and that rests."""
    clearance_m = np.empty((len(obstacles), *paths.x_m.shape))
    for row_m, obstacle in zip(clearance_m, obstacles, strict=True):
        row_m[:] = predicted_clearance_m(obstacle, paths.x_m, paths.y_m, paths.time_s[:, None])
    resting_m = np.where(is_within_horizon(paths.time_s, config), clearance_m[:, :, -1], np.inf)
    return DynamicClearance(clearance_m[:, :, :-2], clearance_m[:, :, -2], np.minimum.accumulate(resting_m, axis=1))


def is_within_horizon(time_s: F64, config: PlannerConfig) -> Bools:
    """Which times lie within `horizon_s` [times]."""
    return np.asarray(time_s <= config.horizon_s + 1e-9)


def position_deviation_m(obstacle: DynamicObstacle, time_s: F64 | float) -> F64 | float:
    """Standard deviation of the obstacle's predicted position at these times from now."""
    grown_m = obstacle.velocity.deviation_mps * (time_s + obstacle.age_s) + UNSEEN_GROWTH_MPS * obstacle.age_s
    return grown_m + obstacle.position_std_m


def required_clearance_m(time_s: F64, resting_m: float | F64, config: PlannerConfig) -> F64:
    """Clearance that a trajectory must keep at each time: hull, margin, and drift within the horizon (Q6).

    `resting_m` is the clearance of the boat at rest. Where that is less, half a cell less than that is required, so
    that a boat beside an obstacle can leave it; inside an obstacle both are negative.
    """
    drift_m = np.where(is_within_horizon(time_s, config), config.drift_mps * time_s, 0.0)
    radius_m = config.hull_radius_m + config.margin_m + drift_m
    return np.asarray(np.minimum(radius_m, resting_m - 0.5 * CELL_M))


def margins(config: PlannerConfig) -> list[PlannerConfig]:
    """The settings with ever smaller margins and drift.

    They are the whole margin, half way to that of Q6, that of Q6, and hull and half a cell without drift.
    """
    half_way_m = 0.5 * (config.margin_m + config.tight_margin_m)
    less = ((half_way_m, config.drift_mps), (config.tight_margin_m, config.drift_mps), (0.5 * CELL_M, 0.0))
    tighter = [(margin_m, drift_mps) for margin_m, drift_mps in less if margin_m < config.margin_m]
    return [config, *(msgspec.structs.replace(config, margin_m=m, drift_mps=d) for m, d in tighter)]


def separation_margin_m(clearance: DynamicClearance, time_s: F64, config: PlannerConfig) -> F64:
    """Clearance to each dynamic obstacle beyond the required one, negative where it is too near, as `candidates_m`.

    An obstacle that comes near a boat at rest may come as near on the trajectory, but no nearer, and no trajectory may
    enter the room kept around it.
    """
    required_m = np.maximum(required_clearance_m(time_s, clearance.resting_m, config), 0.0)
    return np.asarray(clearance.candidates_m - required_m[:, :, None])


def least_of_obstacles_m(each_m: F64) -> F64:
    """The smallest of all obstacles [obstacles, ...]; infinite without any."""
    return np.asarray(each_m.min(axis=0, initial=np.inf))


def advanced_in_time(obstacle: DynamicObstacle, lead_s: float) -> DynamicObstacle:
    """The obstacle where it will be `lead_s` later: a trajectory that comes near that one passes ahead of it."""
    velocity = obstacle.velocity
    return obstacle._replace(
        east_m=obstacle.east_m + lead_s * velocity.east_mps, north_m=obstacle.north_m + lead_s * velocity.north_mps
    )


def closest_point_of_approach(obstacle: DynamicObstacle, boat: BoatState) -> Approach:
    """The CPA within `APPROACH_S` of an obstacle and a boat that both keep their velocity."""
    cos, sin = portable.cos(boat.yaw_rad), portable.sin(boat.yaw_rad)
    east_mps = obstacle.velocity.east_mps - (boat.surge_mps * cos - boat.sway_mps * sin)
    north_mps = obstacle.velocity.north_mps - (boat.surge_mps * sin + boat.sway_mps * cos)
    east_m, north_m = obstacle.east_m - boat.x_m, obstacle.north_m - boat.y_m
    closing = -(east_m * east_mps + north_m * north_mps)
    time_s = np.clip(closing / max(east_mps * east_mps + north_mps * north_mps, 1e-12), 0.0, APPROACH_S)
    cpa_m = np.hypot(east_m + time_s * east_mps, north_m + time_s * north_mps)
    nearest = int(cpa_m.argmin())
    return Approach(float(np.hypot(east_m, north_m).min()), float(cpa_m[nearest]), float(time_s[nearest]))


def is_coming_near(obstacle: DynamicObstacle, at_rest: BoatState, limit_m: float) -> bool:
    """Whether an obstacle that moves for certain will come nearer than the limit to a boat at rest there.

    An obstacle that is as near already, and comes no nearer, does not count.
    """
    if not obstacle.is_moving:
        return False
    approach = closest_point_of_approach(obstacle, at_rest)
    room_m = limit_m + obstacle.standoff_m + UNSEEN_GROWTH_MPS * obstacle.age_s
    return approach.cpa_m < min(room_m, approach.now_m - ESCAPE_GAIN_M)
