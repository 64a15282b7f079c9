"""Depth of the water: a flat bottom, and shoals that rise from it as caps of ellipsoids. Pure.

A cap whose ellipsoid is `CAP_HEIGHTS` times as high as it is nearly a parabola: steepest at its foot, 2.3 times as
steep as on the whole, as sand lies, and not upright there as half an ellipsoid is.
"""

import math

from paani_sim.worlds.world import Shoal, World

SHOAL_GEOM_PREFIX = "shoal_"  # of the names of a world's shoals, in their order
CAP_HEIGHTS = 4.0  # height of half the ellipsoid, of the height of its cap
CAP_WIDTH = math.sqrt(1.0 - (1.0 - 1.0 / CAP_HEIGHTS) ** 2)  # radius of the cap at its foot, of the ellipsoid's


def depth_at_m(world: World, x_m: float, y_m: float) -> float:
    """From the water's surface at rest down to the bottom, or to the shoal that is highest there."""
    return min((_depth_over_m(each, world.bottom_m, x_m, y_m) for each in world.shoals), default=world.bottom_m)


def semi_axes_m(shoal: Shoal, bottom_m: float) -> tuple[float, float]:
    """Of the shoal's ellipsoid, across and upwards. Its top is the shoal's."""
    return shoal.radius_m / CAP_WIDTH, CAP_HEIGHTS * (bottom_m - shoal.top_m)


def radius_at_depth_m(shoal: Shoal, bottom_m: float, depth_m: float) -> float:
    """How far from its middle the water over a shoal is so deep; 0 where it is deeper all over."""
    across_m, upward_m = semi_axes_m(shoal, bottom_m)
    part = 1.0 - (depth_m - shoal.top_m) / upward_m
    return min(across_m * math.sqrt(max(0.0, 1.0 - part * part)), shoal.radius_m) if part < 1.0 else 0.0


def find_aground(world: World, x_m: float, y_m: float, draught_m: float, reach_m: float) -> int | None:
    """The number of the first shoal that rises above the draught within `reach_m` of a point."""
    for number, shoal in enumerate(world.shoals):
        dry_m = radius_at_depth_m(shoal, world.bottom_m, draught_m)
        if dry_m > 0.0 and math.hypot(shoal.x_m - x_m, shoal.y_m - y_m) < dry_m + reach_m:
            return number
    return None


def _depth_over_m(shoal: Shoal, bottom_m: float, x_m: float, y_m: float) -> float:
    away_m = math.hypot(x_m - shoal.x_m, y_m - shoal.y_m)
    if away_m >= shoal.radius_m:
        return bottom_m
    across_m, upward_m = semi_axes_m(shoal, bottom_m)
    return shoal.top_m + upward_m * (1.0 - math.sqrt(1.0 - (away_m / across_m) ** 2))
