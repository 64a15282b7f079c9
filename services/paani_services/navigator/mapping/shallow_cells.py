"""Shallow water on the planner's grid: its cells are occupied. Pure; it adds obstacles and removes none."""

from collections.abc import Iterable

import numpy as np

from paani_services.navigator.mapping.observed_cells import CELL_M
from paani_services.navigator.mapping.occupancy_grid import GRID_CELLS, OccupancyGrid
from paani_services.navigator.mapping.soundings import SHALLOW_CELL_M, ShallowCell

SPLIT = round(SHALLOW_CELL_M / CELL_M)  # cells of the grid along each side of a shallow one

CellNumbers = tuple[tuple[int, int], ...]


def cells_on_grid(cells: Iterable[ShallowCell], position_m: tuple[float, float]) -> CellNumbers:
    """The numbers of the cells that may lie on a grid around a position."""
    reach = GRID_CELLS // (2 * SPLIT) + 1
    column, row = (round(at_m / SHALLOW_CELL_M) for at_m in position_m)
    near = [each for each in cells if abs(each.column - column) <= reach and abs(each.row - row) <= reach]
    return tuple((each.column, each.row) for each in near)


def apply_shallow_cells(grid: OccupancyGrid, cells: CellNumbers) -> OccupancyGrid:
    """Occupy the cells; nothing that is occupied already becomes anything else."""
    if not cells:
        return grid
    shallow = np.zeros((GRID_CELLS, GRID_CELLS), np.bool_)
    west, south = round(grid.west_m / CELL_M), round(grid.south_m / CELL_M)
    for column, row in cells:
        left, low = SPLIT * column - west, SPLIT * row - south
        shallow[max(low, 0) : max(low + SPLIT, 0), max(left, 0) : max(left + SPLIT, 0)] = True
    return grid.with_occupied(shallow)
