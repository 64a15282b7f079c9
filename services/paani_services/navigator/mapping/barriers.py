"""What stood in the water where the boat has been: cells of 0.4 m, remembered longer and wider than the grid. Pure.

The grid around the boat is what it avoids. The barriers only tell which way leads round a dead end.
"""

import math
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from paani.arrays import Bools
from paani_services.navigator.mapping.observed_cells import CELL_M
from paani_services.navigator.mapping.occupancy_grid import GRID_CELLS, OccupancyGrid

SPLIT = 2  # cells of the grid along each side of a barrier's
BARRIER_CELL_M = SPLIT * CELL_M
BARRIER_CELLS = 100  # along each side of the square around the boat in which barriers are remembered: 40 m
REMEMBERED_S = 600.0  # in which a boat at half its speed goes along the square's side and back twice

Cells = NDArray[np.int32]


class BarrierMemory(msgspec.Struct, frozen=True):
    """cells: int32 [n, 3]: column and row from the origin of dead reckoning, and the second when it was last seen."""

    cells: bytes = b""


class Barriers(NamedTuple):
    """Which cells of a square are barred [north, east], and the numbers of its first column and row."""

    is_barred: Bools
    west: int
    south: int


def update_barriers(memory: BarrierMemory, grid: OccupancyGrid, now_us: int) -> BarrierMemory:
    """Add what the grid shows to stand in the water, forget what it shows to be free, is far off, or old.

    Whoever swims is no barrier, nor is what moves: that is not on the grid.
    """
    column, row = (round(at_m / CELL_M) for at_m in (grid.west_m, grid.south_m))
    left, low = -column % SPLIT, -row % SPLIT
    count = (GRID_CELLS - SPLIT + 1) // SPLIT
    west, south = (column + left) // SPLIT, (row + low) // SPLIT
    shape = count, SPLIT, count, SPLIT
    part = slice(low, low + SPLIT * count), slice(left, left + SPLIT * count)
    stands = np.any((grid.occupied & ~grid.possible_people)[part].reshape(shape), axis=(1, 3))
    is_free = np.all(grid.free[part].reshape(shape), axis=(1, 3))
    second = now_us // 1_000_000 % (1 << 31)  # A clock that is wrong may be decades ahead.
    old = _cells_of(memory)
    old = old[second - old[:, 2] <= REMEMBERED_S]
    off = np.abs(old[:, :2] - (west + count // 2, south + count // 2))
    old = old[(off <= BARRIER_CELLS // 2).all(axis=1)]
    across, up = old[:, 0] - west, old[:, 1] - south
    is_shown = (across >= 0) & (across < count) & (up >= 0) & (up < count)
    is_known = np.zeros(len(old), np.bool_)
    is_known[is_shown] = (stands | is_free)[up[is_shown], across[is_shown]]
    rows, columns = np.nonzero(stands)
    new = np.stack([columns + west, rows + south, np.full(rows.size, second)], axis=1).astype(np.int32)
    return BarrierMemory(np.concatenate([old[~is_known], new]).tobytes())


def barriers_around(memory: BarrierMemory, position_m: tuple[float, float]) -> Barriers:
    """The square around a position."""
    west, south = (math.floor(at_m / BARRIER_CELL_M) - BARRIER_CELLS // 2 for at_m in position_m)
    cells = _cells_of(memory)
    across, up = cells[:, 0] - west, cells[:, 1] - south
    inside = (across >= 0) & (across < BARRIER_CELLS) & (up >= 0) & (up < BARRIER_CELLS)
    is_barred = np.zeros((BARRIER_CELLS, BARRIER_CELLS), np.bool_)
    is_barred[up[inside], across[inside]] = True
    return Barriers(is_barred, west, south)


def _cells_of(memory: BarrierMemory) -> Cells:
    return np.frombuffer(memory.cells, np.int32).reshape(-1, 3)
