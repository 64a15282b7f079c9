"""Shallow water on the grid: it adds obstacles there, and takes nothing away from what the camera saw."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paani_services.navigator.mapping.observed_cells import CELL_M
from paani_services.navigator.mapping.occupancy_grid import GRID_CELLS, OccupancyGrid
from paani_services.navigator.mapping.shallow_cells import apply_shallow_cells, cells_on_grid
from paani_services.navigator.mapping.soundings import SHALLOW_CELL_M, ShallowCell

SHAPE = (GRID_CELLS, GRID_CELLS)


def seen_grid(seed: int, west: int, south: int) -> OccupancyGrid:
    rng = np.random.default_rng(seed)
    layers = [rng.random(SHAPE) < 0.3 for _ in range(7)]
    return OccupancyGrid(west * CELL_M, south * CELL_M, *layers)


@given(
    st.integers(0, 1000),
    st.integers(-300, 300),
    st.integers(-300, 300),
    st.lists(st.tuples(st.integers(-20, 70), st.integers(-20, 70)), max_size=30),
)
@pytest.mark.slow
def test_obstacles_are_added_and_none_is_removed(
    seed: int, west: int, south: int, offsets: list[tuple[int, int]]
) -> None:
    """Most of them on the grid, the others beside it."""
    before = seen_grid(seed, west, south)
    numbers = tuple((west // 2 + column, south // 2 + row) for column, row in offsets)
    after = apply_shallow_cells(before, numbers)
    assert (after.occupied | ~before.occupied).all()
    assert not (after.free & ~before.free).any()
    assert not (after.blind_zone & ~before.blind_zone).any()
    assert not (after.free & after.occupied & ~before.occupied).any()
    for name in ("occluded", "people", "reachable_unseen", "possible_people"):
        assert (getattr(after, name) == getattr(before, name)).all()
    rows, columns = np.nonzero(after.occupied & ~before.occupied)
    for row, column in zip(rows.tolist(), columns.tolist(), strict=True):
        middle_m = (west + column + 0.5) * CELL_M, (south + row + 0.5) * CELL_M
        assert tuple(int(np.floor(at_m / SHALLOW_CELL_M)) for at_m in middle_m) in set(numbers)


@given(st.floats(-9.5, 9.5), st.floats(-9.5, 9.5), st.floats(-500.0, 500.0), st.floats(-500.0, 500.0))
def test_a_shallow_place_near_the_boat_is_an_obstacle_there(
    east_m: float, north_m: float, x_m: float, y_m: float
) -> None:
    west, south = (int(np.floor(at_m / CELL_M)) - GRID_CELLS // 2 for at_m in (x_m, y_m))
    place = x_m + east_m, y_m + north_m
    column, row = (int(np.floor(at_m / SHALLOW_CELL_M)) for at_m in place)
    near = cells_on_grid((ShallowCell(column, row, 0, True), ShallowCell(column + 99, row, 0, True)), (x_m, y_m))
    assert near == ((column, row),)
    empty = OccupancyGrid(west * CELL_M, south * CELL_M, *([np.zeros(SHAPE, np.bool_)] * 7))
    occupied = apply_shallow_cells(empty, near).occupied
    at = int(np.floor(place[1] / CELL_M)) - south, int(np.floor(place[0] / CELL_M)) - west
    assert occupied[at]
    assert occupied.sum() == 4
