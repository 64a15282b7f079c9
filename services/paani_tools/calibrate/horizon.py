"""The far waterline in one picture: a straight line through most ends of the water. Pure, but for the RNG passed in."""

from typing import NamedTuple

import numpy as np

from paani.arrays import F64
from paani.messages import Evidence

NEAR_ROWS = 0.75  # of one mask row: how far an end may lie off the line
MIN_SHARE = 0.5  # of the columns must lie on it
TRIES = 80
MIN_SPREAD = 0.4  # of the picture's width, between the outermost of them


class Waterline(NamedTuple):
    """Ends of the water on the line: fractions of width and height [n], and the picture's width over height.

    rows: of the mask they were read from.
    """

    u: F64
    v: F64
    aspect: float
    rows: int


def fit_waterline(evidence: Evidence, rng: np.random.Generator) -> Waterline | None:
    """The line by random sample consensus; None where no line holds half of the columns.

    What stands before the shore ends the water lower, and a hole in the mask higher: both are left out.
    """
    v = np.array(evidence.water_edge)
    if not evidence.usable or v.size < 8 or evidence.height_px < 1 or evidence.width_px < 1:
        return None
    u = (np.arange(v.size) + 0.5) / v.size
    rows = _rows(v)
    ended = (v > 0.0) & (v < 1.0)
    best = np.zeros(v.size, np.bool_)
    where = np.flatnonzero(ended)
    if where.size < MIN_SHARE * v.size:
        return None
    for _ in range(TRIES):
        first, second = rng.choice(where, 2, replace=False)
        slope = (v[second] - v[first]) / (u[second] - u[first])
        near = ended & (np.abs(v - v[first] - slope * (u - u[first])) <= NEAR_ROWS / rows)
        if near.sum() > best.sum():
            best = near
    if best.sum() >= 2:  # two ends of whole rows lean: the line through all of its ends is the better one
        slope, level = np.polyfit(u[best], v[best], 1)
        near = ended & (np.abs(v - slope * u - level) <= NEAR_ROWS / rows)
        best = near if near.sum() > best.sum() else best
    if best.sum() < MIN_SHARE * v.size or np.ptp(u[best]) < MIN_SPREAD:
        return None
    return Waterline(u[best], v[best], evidence.width_px / evidence.height_px, rows)


def _rows(v: F64) -> int:
    """How many rows the mask has: the fewest of which all ends are multiples."""
    return next((rows for rows in (32, 64, 128, 256) if np.allclose(v * rows, np.round(v * rows), atol=1e-6)), 256)
