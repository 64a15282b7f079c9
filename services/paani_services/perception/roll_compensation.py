"""Roll compensation: the class mask turned so that the corridors stay level with the horizon. Pure.

Roll is positive with starboard down (x forward, y left, z up), so the horizon then rises to the right.
"""

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from paani.arrays import F32, U8
from paani.geometry import clip


class LevelledMask(NamedTuple):
    """Class mask uint8, confidence float32 and visible fraction of each cell, level with the horizon: [h, w]."""

    mask: U8
    confidence: F32
    visible_frac: F32


def level_mask(mask: U8, confidence: F32, visible_frac: F32, roll_rad: float, aspect: float) -> LevelledMask:
    """Turn the grids about the picture's centre so that the horizon lies flat.

    aspect: width over height of the picture in pixels. Cells from outside the picture have a visible fraction of 0.
    """
    if roll_rad == 0.0:
        return LevelledMask(mask, confidence, visible_frac)
    height, width = mask.shape
    cell_aspect = aspect * height / width  # width of a cell over its height
    cos, sin = np.cos(roll_rad), np.sin(roll_rad)
    centre_x, centre_y = (width - 1) / 2.0, (height - 1) / 2.0
    rotation = np.array([[cos, sin / cell_aspect], [-sin * cell_aspect, cos]])
    shift = np.array([centre_x, centre_y]) - rotation @ np.array([centre_x, centre_y])
    transform = np.column_stack((rotation, shift)).astype(np.float64)

    def rotate(grid: NDArray[np.generic]) -> NDArray[np.generic]:
        flags = cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP
        return np.asarray(cv2.warpAffine(grid, transform, (width, height), flags=flags, borderValue=(0,)))

    return LevelledMask(
        np.asarray(rotate(mask), np.uint8),
        np.asarray(rotate(confidence), np.float32),
        np.asarray(rotate(visible_frac), np.float32),
    )


def limit_roll_rad(roll_rad: float, max_roll_rad: float) -> float:
    """The roll that the corridors follow: the boat's, up to the limit."""
    return clip(roll_rad, -max_roll_rad, max_roll_rad)
