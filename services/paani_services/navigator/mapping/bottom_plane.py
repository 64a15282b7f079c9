"""The bottom as a plane fitted to soundings. Pure.

Bayesian linear regression (Bishop: "Pattern Recognition and Machine Learning", 2006, section 3.3) on east and north:
soundings along a straight way say nothing of the slope across it, which stays what it is taken to be beforehand, none,
with its standard deviation.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

PRIOR_SLOPE_STD = 0.2  # of slopes that are not measured: sandbanks are seldom steeper than one in five
STD_M, STD_FRAC = 0.01, 0.01  # of a sounding, as cheap sounders state it; the residual counts where it is larger
MIN_SOUNDINGS, MIN_WAY_M = 5, 0.4  # below that a slope is noise
CERTAIN_STD = 2.0  # standard deviations by which a slope differs from none, and a depth from what is shallow


class Slopes(NamedTuple):
    """How much deeper the bottom gets eastward and northward [m/m], and how sure that is.

    std_m: of a sounding. ee, en, nn: the inverse of the slopes' covariance, times that variance.
    """

    down_east: float
    down_north: float
    std_m: float
    ee: float
    en: float
    nn: float

    def std_along(self, east_m: float, north_m: float) -> float:
        """Standard deviation of the change of depth over this way [m]."""
        det = self.ee * self.nn - self.en * self.en
        square = self.nn * east_m * east_m - 2.0 * self.en * east_m * north_m + self.ee * north_m * north_m
        return self.std_m * math.sqrt(square / det)


class Bottom(NamedTuple):
    """The plane: its depth at the middle of so many soundings, and its slopes."""

    east_m: float
    north_m: float
    depth_m: float
    number: int
    slopes: Slopes

    def depth_at(self, x_m: float, y_m: float) -> tuple[float, float]:
        """The depth at a place and its standard deviation [m]."""
        off_east_m, off_north_m, slopes = x_m - self.east_m, y_m - self.north_m, self.slopes
        depth_m = self.depth_m + slopes.down_east * off_east_m + slopes.down_north * off_north_m
        middle_std_m = slopes.std_m / math.sqrt(self.number)
        return depth_m, math.hypot(middle_std_m, slopes.std_along(off_east_m, off_north_m))

    @property
    def upward(self) -> tuple[float, float, float]:
        """The slope plus its standard deviation, and the way up as a unit vector; no slope where none is certain."""
        slope = math.hypot(self.slopes.down_east, self.slopes.down_north)
        if slope == 0.0:
            return 0.0, 0.0, 0.0
        east, north = -self.slopes.down_east / slope, -self.slopes.down_north / slope
        std = self.slopes.std_along(east, north)
        return (slope + std, east, north) if slope > CERTAIN_STD * std else (0.0, east, north)


def fit_bottom(soundings: Sequence[tuple[float, float, float]]) -> Bottom | None:
    """East, north and depth of each sounding in; None where they are too few or too near to each other."""
    count = len(soundings)
    if count < MIN_SOUNDINGS or math.dist(soundings[0][:2], soundings[-1][:2]) < MIN_WAY_M:
        return None
    east_m, north_m, depth_m = (math.fsum(axis) / count for axis in zip(*soundings, strict=True))
    rows = [(x_m - east_m, y_m - north_m, d_m - depth_m) for x_m, y_m, d_m in soundings]
    first = _solve(rows, STD_M + STD_FRAC * depth_m)
    residual_m2 = math.fsum(_square(d - first.down_east * x - first.down_north * y) for x, y, d in rows) / (count - 3)
    fit = _solve(rows, max(STD_M + STD_FRAC * depth_m, math.sqrt(residual_m2)))
    return Bottom(east_m, north_m, depth_m, count, fit)


def _solve(rows: Sequence[tuple[float, float, float]], std_m: float) -> Slopes:
    """The slopes of centred soundings that err by a standard deviation."""
    prior = _square(std_m / PRIOR_SLOPE_STD)
    ee, nn = (math.fsum(row[k] * row[k] for row in rows) + prior for k in (0, 1))
    en, ed, nd = (math.fsum(row[i] * row[k] for row in rows) for i, k in ((0, 1), (0, 2), (1, 2)))
    det = ee * nn - en * en
    return Slopes((nn * ed - en * nd) / det, (ee * nd - en * ed) / det, std_m, ee, en, nn)


def _square(value: float) -> float:
    """As `value ** 2`, whose last bit is the machine's."""
    return value * value
