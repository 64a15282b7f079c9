"""Distance fields on the grid."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paani_services.navigator.mapping.distance_field import distance_field_m
from paani_services.navigator.mapping.observed_cells import CELL_M
from paani_services.navigator.mapping.occupancy_grid import GRID_CELLS


@settings(max_examples=10, deadline=None)
@given(cells=st.lists(st.tuples(st.integers(0, 99), st.integers(0, 99)), max_size=12))
@pytest.mark.slow
def test_distances_are_those_to_the_nearest_cell(cells: list[tuple[int, int]]) -> None:
    mask = np.zeros((GRID_CELLS, GRID_CELLS), np.bool_)
    for row, column in cells:
        mask[row, column] = True
    rows, columns = np.indices(mask.shape)
    exact = np.full(mask.shape, 4.0)
    for row, column in cells:
        exact = np.minimum(exact, np.hypot(rows - row, columns - column) * CELL_M)
    assert distance_field_m(mask) == pytest.approx(exact)
