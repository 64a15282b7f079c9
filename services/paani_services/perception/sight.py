"""What of the picture counts, and how it is level: own hull left out, corridors turned with the horizon. Pure.

Roll is positive with starboard down (x forward, y left, z up), so the horizon then rises to the right.
"""

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from paani.arrays import F32, U8
from paani.geometry import clip
from paani.messages import BoxXyxy

Polygon = tuple[tuple[float, float], ...]
OWN_HULL_FRAC = 0.8  # a box that lies this far in the ego polygon is the boat itself
FINE = 8  # the polygon is drawn this many times finer than the grid


class Level(NamedTuple):
    """A class mask uint8 and confidence float32, level with the horizon, and how much of each cell counts: [h, w]."""

    mask: U8
    confidence: F32
    counts: F32


def counted(polygon: Polygon, height: int, width: int) -> F32:
    """How much of each cell lies outside the own hull: float32 [height, width] in [0, 1].

    polygon: normalised corners; empty: everything counts.
    """
    if not polygon:
        return np.ones((height, width), np.float32)
    fine = np.zeros((height * FINE, width * FINE), np.uint8)
    corners = np.array([(x * width * FINE, y * height * FINE) for x, y in polygon])
    cv2.fillPoly(fine, [np.round(corners).astype(np.int32)], (1,))
    covered = fine.reshape(height, FINE, width, FINE).mean((1, 3))
    return np.asarray(1.0 - covered, np.float32)


def level(mask: U8, confidence: F32, counts: F32, roll_rad: float, aspect: float) -> Level:
    """Turn the grids about the picture's centre so that the horizon lies flat.

    aspect: width over height of the picture in pixels. Cells that come from outside the picture count for nothing.
    """
    if roll_rad == 0.0:
        return Level(mask, confidence, counts)
    height, width = mask.shape
    across = aspect * height / width  # width of a cell in heights of a cell
    cos, sin = np.cos(roll_rad), np.sin(roll_rad)
    centre_x, centre_y = (width - 1) / 2.0, (height - 1) / 2.0
    turn = np.array([[cos, sin / across], [-sin * across, cos]])
    shift = np.array([centre_x, centre_y]) - turn @ np.array([centre_x, centre_y])
    where = np.column_stack((turn, shift)).astype(np.float64)

    def turned(grid: NDArray[np.generic]) -> NDArray[np.generic]:
        flags = cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP
        return np.asarray(cv2.warpAffine(grid, where, (width, height), flags=flags, borderValue=(0,)))

    return Level(
        np.asarray(turned(mask), np.uint8),
        np.asarray(turned(confidence), np.float32),
        np.asarray(turned(counts), np.float32),
    )


def is_own_hull(box: BoxXyxy, counts: F32) -> bool:
    """Does the box show little but the boat itself? counts: of the unturned picture."""
    height, width = counts.shape
    x1, y1, x2, y2 = box
    left, right = int(x1 * width), max(int(x1 * width) + 1, int(np.ceil(x2 * width)))
    top, bottom = int(y1 * height), max(int(y1 * height) + 1, int(np.ceil(y2 * height)))
    part = counts[top:bottom, left:right]
    return bool(part.size and 1.0 - float(part.mean()) >= OWN_HULL_FRAC)


def followed_roll_rad(roll_rad: float, max_roll_rad: float) -> float:
    """The roll that the corridors follow; a larger one is followed as far as allowed."""
    return clip(roll_rad, -max_roll_rad, max_roll_rad)
