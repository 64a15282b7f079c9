"""The planner within a fence: cells beyond it are occupied."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paani.fence_geometry import is_allowed
from paani.messages import FenceArea, Keep, Waypoint
from paani_services.navigator.avoidance.fence_cells import apply_fence
from paani_services.navigator.avoidance.replanning import PlannerState, replan
from paani_services.navigator.avoidance.rollout import BoatState, GuidanceSetpoint, Plan
from paani_services.navigator.mapping.observed_cells import CELL_M
from paani_services.navigator.mapping.occupancy_grid import GRID_CELLS
from tests.synthetic_water import (
    AT_REST,
    CAMERA,
    PLANNER,
    START_US,
    Bar,
    observe_from,
    odometry,
    plan_on,
    pool,
    water_edge_of,
)

ATHWART: Bar = (3.6, -0.9, 4.2, 0.9)
AHEAD = GuidanceSetpoint(0.0, 0.6)
RESTING = BoatState(0.0, 0.0, 0.0)


def area(keep: Keep, *corners: tuple[float, float]) -> FenceArea:
    return FenceArea(keep=keep, corners=tuple(Waypoint(x_m=x, y_m=y) for x, y in corners))


def box(keep: Keep, x1: float, y1: float, x2: float, y2: float) -> FenceArea:
    return area(keep, (x1, y1), (x2, y1), (x2, y2), (x1, y2))


POINT = st.tuples(st.floats(-12.0, 12.0), st.floats(-12.0, 12.0))


@settings(deadline=None)
@given(st.lists(POINT, min_size=3, max_size=7), st.lists(POINT, min_size=3, max_size=5))
@pytest.mark.slow
def test_a_cell_is_occupied_where_its_middle_is_not_allowed(
    inner: list[tuple[float, float]], outer: list[tuple[float, float]]
) -> None:
    """For any polygons, even self-crossing ones, the verdict is that of `is_allowed`. No middle lies on an edge."""
    inner, outer = ([(x_m + 0.0137, y_m + 0.0291) for x_m, y_m in corners] for corners in (inner, outer))
    fence = (area(Keep.IN, *inner), area(Keep.OUT, *outer))
    grid = apply_fence(pool(), fence)
    for row in range(0, GRID_CELLS, 9):
        for column in range(0, GRID_CELLS, 9):
            middle = (grid.west_m + CELL_M * (column + 0.5), grid.south_m + CELL_M * (row + 0.5))
            assert bool(grid.occupied[row, column]) is not is_allowed(fence, middle)


def test_a_fence_frees_nothing_and_changes_nothing_inside() -> None:
    """Beyond the fence nothing is free; within it every cell stays as it was."""
    before = pool(ATHWART)
    after = apply_fence(before, (box(Keep.IN, -50.0, -50.0, 2.0, 50.0),))
    within = np.broadcast_to(np.arange(GRID_CELLS) * CELL_M + before.west_m < 1.9, (GRID_CELLS, GRID_CELLS))
    for name in ("occupied", "free", "blind_zone", "occluded"):
        assert (getattr(after, name) & within == getattr(before, name) & within).all()
    assert after.occupied[~within & (np.arange(GRID_CELLS) * CELL_M + before.west_m > 2.1)].all()
    assert not (after.free & after.occupied).any()
    assert apply_fence(before, ()) is before


def test_the_fence_is_shifted_from_the_map_to_the_frame_of_dead_reckoning() -> None:
    """A place 2 m east on the grid is 5 m east in the map."""
    fence = (box(Keep.IN, -50.0, -50.0, 5.0, 50.0),)
    east_m = np.arange(GRID_CELLS) * CELL_M + pool().west_m
    barred = apply_fence(pool(), fence, (3.0, 0.0)).occupied
    assert barred[:, east_m > 2.0].all()
    assert not barred[:, east_m < 1.8].any()


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_an_obstacle_is_passed_on_the_side_that_the_fence_leaves(side: float) -> None:
    fence = (box(Keep.OUT, -2.0, side * 0.9, 12.0, side * 9.0),)
    found = plan_on(apply_fence(pool(ATHWART), fence), RESTING, AHEAD, None, PLANNER)
    assert found.speed_mps > 0.0
    assert math.copysign(1.0, found.heading_rad) == -side


def test_the_boat_stops_where_the_fence_leaves_no_candidate() -> None:
    """On the same water without the fence it does not stop."""
    at_rest, memory = odometry(START_US, AT_REST), observe_from(edge=water_edge_of(AT_REST, bank_m=500.0))
    fence = (box(Keep.IN, -1.0, -1.0, 1.6, 1.0),)

    def ordered(within: tuple[FenceArea, ...]) -> Plan:
        return replan(PlannerState(memory), at_rest, AHEAD, START_US, CAMERA, PLANNER, within)[1]

    assert ordered(()).speed_mps > 0.0
    assert ordered(fence).speed_mps == 0.0
