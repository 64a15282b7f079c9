"""Cells of an occupancy grid as numbers, and packed as its message carries them."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from paani.messages import OccupancyGrid

U8 = npt.NDArray[np.uint8]
CELLS_PER_BYTE = 4
SHIFTS = np.arange(0, 8, 2, dtype=np.uint8)


def pack_cells(cells: U8) -> bytes:
    """Values of `Occupancy` [rows, columns] as `OccupancyGrid.cells`."""
    padded = np.zeros(-(-cells.size // CELLS_PER_BYTE) * CELLS_PER_BYTE, np.uint8)
    padded[: cells.size] = cells.ravel()
    packed: U8 = np.bitwise_or.reduce(padded.reshape(-1, CELLS_PER_BYTE) << SHIFTS, axis=1).astype(np.uint8)
    return packed.tobytes()


def unpack_cells(grid: OccupancyGrid) -> U8:
    """Values of `Occupancy` [rows, columns]. Raises ValueError where they are more or fewer than the grid's cells."""
    count = grid.rows * grid.columns
    if len(grid.cells) != -(-count // CELLS_PER_BYTE):
        raise ValueError(f"{len(grid.cells)} bytes are not the cells of {grid.rows} x {grid.columns}")
    packed = np.frombuffer(grid.cells, np.uint8)
    return np.asarray((packed[:, None] >> SHIFTS & 3).ravel()[:count].reshape(grid.rows, grid.columns), np.uint8)
