"""How near a boat comes to what stands and to what moves, and how near it may. Pure."""

from collections.abc import Sequence

import msgspec
import numpy as np

from paani.arrays import F64
from paani.config import PlannerConfig
from paani_services.navigator.avoidance.rollout import Start, Ways
from paani_services.navigator.mapping.distance_field import signed_m
from paani_services.navigator.mapping.dynamic_obstacles import Mover
from paani_services.navigator.mapping.observed_cells import CELL_M
from paani_services.navigator.mapping.occupancy_grid import CELLS, Grid

ASTRAY_MPS = 0.1  # what is out of sight changes its course and speed: measured, 1.2 m in 12 s
AHEAD_S = np.arange(0.0, 30.5, 0.5)  # a boat that turns away from what comes at 0.13 m/s takes 20 s
GAIN_M = 0.1  # of a way out: half a cell


def clearance_m(grid: Grid, config: PlannerConfig) -> F64:
    """From the middle of each cell to what is there, at most 4 m; negative within, the further in the less [100, 100].

    What is out of sight may have drifted nearer; a person or a vessel may be anywhere in `Grid.strayed`.
    """
    drifted_m = signed_m(grid.hidden) - config.hidden_drift_m
    found_m = np.minimum(signed_m(grid.occupied), drifted_m)
    return np.minimum(found_m, signed_m(grid.strayed)) if grid.strayed.any() else found_m


def looked_up(grid: Grid, field: F64, ways: Ways) -> F64:
    """The field at these places, between the middles of four cells; at the rim of the grid, the rim's."""
    column = np.clip((ways.x_m - grid.west_m) / CELL_M - 0.5, 0.0, CELLS - 1.001)
    row = np.clip((ways.y_m - grid.south_m) / CELL_M - 0.5, 0.0, CELLS - 1.001)
    left, low = np.floor(column).astype(np.int64), np.floor(row).astype(np.int64)
    right_part, high_part = column - left, row - low
    flat, at = field.ravel(), low * CELLS + left
    lower = flat[at] * (1.0 - right_part) + flat[at + 1] * right_part
    upper = flat[at + CELLS] * (1.0 - right_part) + flat[at + CELLS + 1] * right_part
    return np.asarray(lower * (1.0 - high_part) + upper * high_part)


def gap_to_m(mover: Mover, x_m: F64, y_m: F64, at_s: F64) -> F64:
    """From places to the outline of a thing that moves on, at these times from now; less what is kept beside it.

    Uncertainty is one standard deviation of its velocity, and `ASTRAY_MPS` from when it was last seen.
    """
    motion = mover.motion
    east_m, north_m = x_m - at_s * motion.east_mps, y_m - at_s * motion.north_mps
    square = np.full(east_m.shape, np.inf)
    for x, y in zip(mover.east_m.tolist(), mover.north_m.tolist(), strict=True):
        east, north = east_m - x, north_m - y
        square = np.minimum(square, east * east + north * north)
    astray_m = motion.deviation_mps * (at_s + mover.age_s) + ASTRAY_MPS * mover.age_s
    return np.asarray(np.sqrt(square) - mover.room_m - astray_m)


def nearest_m(gap_m: F64, movers: Sequence[Mover], ways: Ways) -> F64:
    """To what stands and to what moves [times, candidates]."""
    return np.asarray(
        np.minimum.reduce([gap_m, *(gap_to_m(each, ways.x_m, ways.y_m, ways.at_s[:, None]) for each in movers)])
    )


def footprint_m(at_s: F64, gap_m: float | F64, config: PlannerConfig) -> F64:
    """The radius that must be free at each time: hull, margin, and drift within the horizon (Q6).

    gap_m: to the nearest thing, boat at rest. Where that is less, a way that comes no nearer is allowed: it leads out.
    Within a thing both are negative.
    """
    drift_m = np.where(at_s <= config.horizon_s + 1e-9, config.drift_mps * at_s, 0.0)
    radius_m = config.hull_radius_m + config.margin_m + drift_m
    return np.asarray(np.minimum(radius_m, gap_m - 0.5 * CELL_M))


def margins(config: PlannerConfig) -> list[PlannerConfig]:
    """Margins and drift to keep, the largest first: the whole one, half way to Q6's, that, the hull and half a cell."""
    half_way_m = 0.5 * (config.margin_m + config.tight_margin_m)
    less = ((half_way_m, config.drift_mps), (config.tight_margin_m, config.drift_mps), (0.5 * CELL_M, 0.0))
    tighter = [(margin_m, drift_mps) for margin_m, drift_mps in less if margin_m < config.margin_m]
    return [config, *(msgspec.structs.replace(config, margin_m=m, drift_mps=d) for m, d in tighter)]


def spare_m(mover: Mover, ways: Ways, start: Start, config: PlannerConfig) -> F64:
    """Between the footprint and a thing that moves. What comes near a boat at rest may come no nearer on the way."""
    at_s = ways.at_s[:, None]
    rest_m = gap_to_m(mover, np.full_like(at_s, start.x_m), np.full_like(at_s, start.y_m), at_s)[:, 0]
    rest_m = np.minimum.accumulate(np.where(ways.at_s <= config.horizon_s + 1e-9, rest_m, np.inf))
    kept_m = np.maximum(footprint_m(ways.at_s, rest_m, config), 0.0)  # nothing excuses a way into its room
    return np.asarray(gap_to_m(mover, ways.x_m, ways.y_m, at_s) - kept_m[:, None])


def all_spare_m(movers: Sequence[Mover], ways: Ways, start: Start, config: PlannerConfig) -> F64:
    """`spare_m` of the nearest; without any, without end."""
    far_m = np.full(ways.x_m.shape, np.inf)
    return np.asarray(np.minimum.reduce([far_m, *(spare_m(each, ways, start, config) for each in movers)]))


def led(mover: Mover, lead_s: float) -> Mover:
    """The same so much later: what comes near this one passes ahead of it."""
    motion = mover.motion
    return mover._replace(
        east_m=mover.east_m + lead_s * motion.east_mps, north_m=mover.north_m + lead_s * motion.north_mps
    )


def comes_near(movers: Sequence[Mover], x_m: F64, y_m: F64, tight_m: float) -> bool:
    """Something that moves for certain comes to a boat that lies there [1], if it goes on as it does."""
    for mover in movers:
        as_it_does = mover._replace(motion=mover.motion._replace(deviation_mps=0.0))
        gaps_m = gap_to_m(as_it_does, x_m, y_m, AHEAD_S)
        if mover.is_sure and gaps_m.min() < min(tight_m, gaps_m[0] - GAIN_M):
            return True
    return False
