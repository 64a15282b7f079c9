"""Wind: gusts about a mean, and its force on a hull.

Gusts: first-order Gauss-Markov process. Force: T. I. Fossen, Handbook of Marine Craft Hydrodynamics and
Motion Control, 2nd ed. 2021, section 10.1, for hulls alike fore and aft and from side to side.
"""

import math

import numpy as np

from paani_sim.vessels.vessel import Windage
from paani_sim.worlds.world import Wind

AIR_DENSITY_KGPM3 = 1.225


class Gusts:
    """Wind speed along its mean direction; stationary from the first value on."""

    def __init__(self, wind: Wind, every_s: float, rng: np.random.Generator) -> None:
        """`every_s` passes between two calls of `advance`."""
        self._mean_mps = wind.speed_mps
        self._std_mps = wind.gust_frac * wind.speed_mps
        self._keep = math.exp(-every_s / wind.gust_s)
        self._renew_mps = self._std_mps * math.sqrt(1.0 - self._keep * self._keep)
        self._rng = rng
        self._gust_mps = self._std_mps * float(rng.standard_normal())
        self._toward = math.cos(wind.toward_rad), math.sin(wind.toward_rad)

    def advance(self) -> None:
        """To the next gust."""
        if self._std_mps > 0.0:
            self._gust_mps = self._keep * self._gust_mps + self._renew_mps * float(self._rng.standard_normal())

    @property
    def velocity_mps(self) -> tuple[float, float]:
        """Of the air over ground, in the map frame. A gust never turns the wind round."""
        speed_mps = max(0.0, self._mean_mps + self._gust_mps)
        return speed_mps * self._toward[0], speed_mps * self._toward[1]


def wind_force(ahead_mps: float, left_mps: float, windage: Windage, length_m: float) -> tuple[float, float, float]:
    """Force ahead and to the left [N] and moment to port [N m] of air that moves so past the hull.

    0.5 rho V^2 A times c_x cos, c_y sin and c_n L sin 2 of its angle; the moment turns the hull broadside.
    """
    speed_mps = math.hypot(ahead_mps, left_mps)
    pressure = 0.5 * AIR_DENSITY_KGPM3
    lateral = pressure * windage.lateral_area_m2
    return (
        pressure * windage.frontal_area_m2 * windage.surge_coefficient * speed_mps * ahead_mps,
        lateral * windage.sway_coefficient * speed_mps * left_mps,
        -2.0 * lateral * windage.yaw_coefficient * length_m * ahead_mps * left_mps,
    )
