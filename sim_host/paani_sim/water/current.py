"""Current: along the channel or one way, and slower towards the banks by the one-seventh power law.

The law is L. Prandtl's for turbulent flow over a wall, with the distance to the bank for the distance to the
bed. Current as a velocity that the hull moves through: T. I. Fossen, Handbook of Marine Craft Hydrodynamics and
Motion Control, 2nd ed. 2021, section 10.3.
"""

import math

import cv2
import numpy as np
import numpy.typing as npt

from paani.arrays import F32, F64
from paani_sim.worlds.world import World

CELL_M = 1.0
EXPONENT = 1.0 / 7.0
_SUBPIXEL_BITS = 8


class CurrentField:
    """Velocity of the water over ground, on a grid made once and interpolated linearly."""

    def __init__(self, world: World) -> None:
        """Only a world with a current has a grid."""
        self._is_still = world.current.speed_mps == 0.0
        if self._is_still:
            return
        low, high = world.shore_m.min(axis=0), world.shore_m.max(axis=0)
        columns, rows = (int(n) + 2 for n in np.ceil((high - low) / CELL_M))
        x_mps, y_mps = _velocity_mps(world, low, (rows, columns))
        self._low_m = float(low[0]), float(low[1])
        self._last = columns - 1.001, rows - 1.001
        self._x_mps: list[list[float]] = x_mps.tolist()
        self._y_mps: list[list[float]] = y_mps.tolist()

    def at(self, x_m: float, y_m: float) -> tuple[float, float]:
        """In the map frame [m/s]; beyond the grid as on its rim."""
        if self._is_still:
            return 0.0, 0.0
        column = min(max((x_m - self._low_m[0]) / CELL_M, 0.0), self._last[0])
        row = min(max((y_m - self._low_m[1]) / CELL_M, 0.0), self._last[1])
        i, j = int(column), int(row)
        right, up = column - i, row - j
        return _interpolate(self._x_mps, i, j, right, up), _interpolate(self._y_mps, i, j, right, up)


def _interpolate(grid: list[list[float]], i: int, j: int, right: float, up: float) -> float:
    below, above = grid[j], grid[j + 1]
    low = below[i] + right * (below[i + 1] - below[i])
    return low + up * (above[i] + right * (above[i + 1] - above[i]) - low)


def _velocity_mps(world: World, low_m: F64, shape: tuple[int, int]) -> tuple[F32, F32]:
    """Both parts on the grid: full in mid-channel (or where land is furthest), nothing ashore."""
    scale = 2**_SUBPIXEL_BITS / CELL_M
    water = np.zeros(shape, np.uint8)
    cv2.fillPoly(water, [np.rint((world.shore_m - low_m) * scale).astype(np.int32)], 1, shift=_SUBPIXEL_BITS)
    bank_cells = cv2.distanceTransform(water, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    bank_m = CELL_M * np.sqrt(np.rint(bank_cells * bank_cells))  # OpenCV's last bit depends on its number of threads
    if world.channel_m is None:
        toward = world.current.toward_rad
        direction = np.array([[math.cos(toward), math.sin(toward)]])
        ahead = np.zeros(shape, int)
        part = bank_m / max(float(bank_m.max()), CELL_M)
    else:
        middle_m, ahead, direction = _project_to_channel(world.channel_m, low_m, shape)
        part = bank_m / np.maximum(bank_m + middle_m, CELL_M)
    speed_mps = world.current.speed_mps * part**EXPONENT
    return speed_mps * direction[ahead, 0], speed_mps * direction[ahead, 1]


def _project_to_channel(channel_m: F64, low_m: F64, shape: tuple[int, int]) -> tuple[F32, npt.NDArray[np.int_], F64]:
    """Distance to the centre line, which of its points is nearest, and the directions of them all."""
    arc_m = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(channel_m, axis=0), axis=1))])
    along_m = np.arange(0.0, arc_m[-1] + CELL_M, CELL_M)
    line_m = np.column_stack([np.interp(along_m, arc_m, channel_m[:, k]) for k in (0, 1)])
    cells = np.rint((line_m - low_m) / CELL_M).astype(int)
    within = ((cells >= 0) & (cells < [shape[1], shape[0]])).all(axis=1)
    columns, rows = cells[within].T
    away = np.ones(shape, np.uint8)
    away[rows, columns] = 0
    distance, label = cv2.distanceTransformWithLabels(
        away, cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )
    nearest = np.zeros(label.max() + 1, int)
    nearest[label[rows, columns]] = np.flatnonzero(within)
    direction = np.gradient(line_m[:-1], axis=0)
    direction = np.vstack([direction, direction[-1:]])
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    return CELL_M * distance, nearest[label], direction
