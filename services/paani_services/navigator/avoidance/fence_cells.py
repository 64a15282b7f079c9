"""The fence on the planner's grid: cells beyond it are occupied. Pure."""

import numpy as np

from paani.arrays import Bools
from paani.fence_geometry import Fence, edges
from paani.messages import FenceArea, Keep
from paani_services.navigator.mapping.observed_cells import CELL_M
from paani_services.navigator.mapping.occupancy_grid import GRID_CELLS, OccupancyGrid


def apply_fence(grid: OccupancyGrid, fence: Fence, offset_m: tuple[float, float] = (0.0, 0.0)) -> OccupancyGrid:
    """Occupy every cell whose middle the fence does not allow, as `is_allowed` has it but for the edges.

    offset_m: a place's east and north in the map, less those on the grid.
    """
    if not fence:
        return grid
    inner = [_inside(grid, area, offset_m) for area in fence if area.keep is Keep.IN]
    allowed = np.logical_or.reduce(inner) if inner else np.ones((GRID_CELLS, GRID_CELLS), np.bool_)
    for area in fence:
        if area.keep is Keep.OUT:
            allowed &= ~_inside(grid, area, offset_m)
    return grid.with_occupied(~allowed)._replace(occluded=grid.occluded & allowed)


def _inside(grid: OccupancyGrid, area: FenceArea, offset_m: tuple[float, float]) -> Bools:
    """Cells whose middle the area contains: a ray to the east crosses its edges an odd number of times."""
    middle = (np.arange(GRID_CELLS) + 0.5) * CELL_M
    x_m, y_m = grid.west_m + offset_m[0] + middle, grid.south_m + offset_m[1] + middle
    inside = np.zeros((GRID_CELLS, GRID_CELLS), np.bool_)
    for (x1, y1), (x2, y2) in edges(area):
        first, last = np.searchsorted(y_m, sorted((y1, y2)))
        if first == last:
            continue
        rows = slice(first, last)
        inside[rows] ^= x_m < ((x2 - x1) * (y_m[rows] - y1) / (y2 - y1) + x1)[:, None]
    return inside
