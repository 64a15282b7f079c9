"""Euclidean distance fields on the grid, one axis after the other. Pure."""

import numpy as np
from numpy.typing import NDArray

from paani.arrays import F64, Bools
from paani_services.navigator.mapping.observed_cells import CELL_M

MAX_DISTANCE_CELLS = 20  # distances are computed up to 4 m and are 4 m beyond [cells]


def distance_field_m(cells: Bools) -> F64:
    """Distance from the middle of each cell to the middle of the nearest cell of the mask, at most 4 m.

    First along each row, then over the rows: padded with rows that are far from any cell of the mask.
    """
    if not cells.any():
        return np.full(cells.shape, CELL_M * MAX_DISTANCE_CELLS)
    place = np.arange(cells.shape[1], dtype=np.int16)
    before = np.maximum.accumulate(np.where(cells, place, -MAX_DISTANCE_CELLS), axis=1)
    after = np.minimum.accumulate(np.where(cells, place, place.size + MAX_DISTANCE_CELLS)[:, ::-1], axis=1)[:, ::-1]
    in_row = np.minimum(np.minimum(place - before, after - place), MAX_DISTANCE_CELLS)
    nearest: NDArray[np.int16] = in_row * in_row
    padding = ((MAX_DISTANCE_CELLS, MAX_DISTANCE_CELLS), (0, 0))
    padded = np.pad(nearest, padding, constant_values=MAX_DISTANCE_CELLS * MAX_DISTANCE_CELLS)
    beside, rows = np.empty_like(nearest), cells.shape[0]
    for off in range(1, MAX_DISTANCE_CELLS):
        low, high = MAX_DISTANCE_CELLS - off, MAX_DISTANCE_CELLS + off
        np.minimum(padded[low : low + rows], padded[high : high + rows], out=beside)
        np.minimum(nearest, np.add(beside, np.int16(off * off), out=beside), out=nearest)
    return CELL_M * np.sqrt(nearest.astype(np.float64))


def signed_distance_field_m(cells: Bools) -> F64:
    """Signed distance: `distance_field_m` outside the mask; inside, minus the distance to leave it, at least -4 m."""
    return np.asarray(distance_field_m(cells) - distance_field_m(~cells))
