"""Euclidean distance fields on the grid, one axis after the other. Pure."""

import numpy as np
from numpy.typing import NDArray

from paani.arrays import F64, Bools
from paani_services.navigator.mapping.observed_cells import CELL_M

MAX_DISTANCE_CELLS = 20  # distances are computed up to 4 m and are 4 m beyond [cells]


def distance_field_m(cells: Bools) -> F64:
    """Distance from the middle of each cell to the middle of the nearest cell of the mask, at most 4 m."""
    far_squared = MAX_DISTANCE_CELLS * MAX_DISTANCE_CELLS
    found: NDArray[np.int16] = np.where(cells, 0, far_squared).astype(np.int16)
    for axis in (0, 1):
        squared = found if axis == 0 else found.T
        nearest = squared.copy()
        for off in range(1, MAX_DISTANCE_CELLS):
            np.minimum(nearest[off:], squared[:-off] + off * off, out=nearest[off:])
            np.minimum(nearest[:-off], squared[off:] + off * off, out=nearest[:-off])
        found = nearest if axis == 0 else nearest.T
    return CELL_M * np.sqrt(found.astype(np.float64))


def signed_distance_field_m(cells: Bools) -> F64:
    """Signed distance: `distance_field_m` outside the mask; inside, minus the distance to leave it, at least -4 m."""
    return np.asarray(distance_field_m(cells) - distance_field_m(~cells))
