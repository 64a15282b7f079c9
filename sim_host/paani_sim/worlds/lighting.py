"""A catalogue of conditions of light and air. They change what is seen, and never where anything is. Pure."""

import math
from typing import NamedTuple

import numpy as np

from paani_sim.worlds.world import Light

SUN_AHEAD_RAD = 0.35  # how far to the side of the boat's course a sun ahead may stand


class LightCondition(NamedTuple):
    """Ranges that a condition is drawn from, and how often it is. `sun_ahead`: before the camera, not anywhere."""

    share: float
    skies: tuple[str, ...]
    sun_elevation_deg: tuple[float, float]
    visibility_m: tuple[float, float]
    rain_mmph: tuple[float, float] = (0.0, 0.0)
    sun_ahead: bool = False


LIGHT_CONDITIONS = {
    "fair": LightCondition(0.30, ("clear", "cloudy"), (20.0, 60.0), (600.0, 1500.0)),
    "overcast": LightCondition(0.14, ("overcast",), (20.0, 60.0), (400.0, 1200.0)),
    "haze": LightCondition(0.10, ("hazy",), (15.0, 50.0), (200.0, 500.0)),
    "fog": LightCondition(0.12, ("hazy", "overcast"), (10.0, 40.0), (45.0, 150.0)),
    "low_sun": LightCondition(0.12, ("clear", "cloudy", "hazy"), (3.0, 14.0), (400.0, 1500.0), sun_ahead=True),
    "rain": LightCondition(0.12, ("overcast",), (20.0, 50.0), (200.0, 700.0), (3.0, 18.0)),
    "dusk": LightCondition(0.10, ("dusk",), (1.0, 8.0), (300.0, 1200.0)),
}


def draw_condition(rng: np.random.Generator) -> str:
    """A condition by its share."""
    shares = np.array([condition.share for condition in LIGHT_CONDITIONS.values()])
    return str(rng.choice(list(LIGHT_CONDITIONS), p=shares / shares.sum()))


def draw_light(name: str, course_rad: float, rng: np.random.Generator) -> Light:
    """Light of a condition of `LIGHT_CONDITIONS`, for a boat on this course."""
    condition = LIGHT_CONDITIONS[name]
    ahead = course_rad + float(rng.uniform(-SUN_AHEAD_RAD, SUN_AHEAD_RAD))
    anywhere = float(rng.uniform(-math.pi, math.pi))
    return Light(
        sky=str(rng.choice(condition.skies)),
        sun_azimuth_rad=ahead if condition.sun_ahead else anywhere,
        sun_elevation_rad=math.radians(float(rng.uniform(*condition.sun_elevation_deg))),
        visibility_m=float(rng.uniform(*condition.visibility_m)),
        seed=int(rng.integers(1 << 30)),
        rain_mmph=float(rng.uniform(*condition.rain_mmph)),
    )
