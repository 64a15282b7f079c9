"""The own hull in the picture: what `perception.ego_polygon` covers is no evidence. Pure."""

import cv2
import numpy as np

from paani.arrays import F32
from paani.messages import BoxXyxy

Polygon = tuple[tuple[float, float], ...]
OWN_HULL_FRAC = 0.8  # a box of which at least this fraction lies in the polygon is the boat itself
SUBCELLS = 8  # the polygon is drawn with this many points per cell and direction


def compute_visible_fractions(polygon: Polygon, height: int, width: int) -> F32:
    """Fraction of each cell that lies outside the own hull: float32 [height, width] in [0, 1].

    polygon: normalised corners; with none, everything is visible.
    """
    if not polygon:
        return np.ones((height, width), np.float32)
    fine = np.zeros((height * SUBCELLS, width * SUBCELLS), np.uint8)
    corners = np.array([(x * width * SUBCELLS, y * height * SUBCELLS) for x, y in polygon])
    cv2.fillPoly(fine, [np.round(corners).astype(np.int32)], (1,))
    covered = fine.reshape(height, SUBCELLS, width, SUBCELLS).mean((1, 3))
    return np.asarray(1.0 - covered, np.float32)


def is_own_hull(box: BoxXyxy, visible_frac: F32) -> bool:
    """Whether a box shows little but the boat itself. visible_frac: of the picture as it is, not levelled."""
    height, width = visible_frac.shape
    x1, y1, x2, y2 = box
    left, right = int(x1 * width), max(int(x1 * width) + 1, int(np.ceil(x2 * width)))
    top, bottom = int(y1 * height), max(int(y1 * height) + 1, int(np.ceil(y2 * height)))
    part = visible_frac[top:bottom, left:right]
    return bool(part.size and 1.0 - float(part.mean()) >= OWN_HULL_FRAC)
