"""Distances on the grid. Pure."""

import numpy as np
from numpy.typing import NDArray

from paani.arrays import F64, Bools
from paani_services.navigator.mapping.observed_cells import CELL_M

FIELD_CELLS = 20  # distances are known up to 4 m


def distance_m(cells: Bools) -> F64:
    """From the middle of each cell to the middle of the nearest of these, at most 4 m; of the mask's shape."""
    far = FIELD_CELLS * FIELD_CELLS
    found: NDArray[np.int16] = np.where(cells, 0, far).astype(np.int16)
    for axis in (0, 1):
        given = found if axis == 0 else found.T
        best = given.copy()
        for off in range(1, FIELD_CELLS):
            np.minimum(best[off:], given[:-off] + off * off, out=best[off:])
            np.minimum(best[:-off], given[off:] + off * off, out=best[:-off])
        found = best if axis == 0 else best.T
    return CELL_M * np.sqrt(found.astype(np.float64))


def signed_m(cells: Bools) -> F64:
    """As `distance_m` outside, inside the negative of what leads out, at least -4 m."""
    return np.asarray(distance_m(cells) - distance_m(~cells))
