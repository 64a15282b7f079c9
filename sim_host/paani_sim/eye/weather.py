"""Uniforms of the shaders from sky, wind, rain and waves. Pure numpy."""

import numpy as np
import numpy.typing as npt

from paani.arrays import F32
from paani_sim.eye.rain import extinction_per_m
from paani_sim.eye.sky import Sky
from paani_sim.eye.surfaces import SPAN_M
from paani_sim.eye.wave_motion import SeaState, wind_sea_state
from paani_sim.eye.wave_textures import mean_square_slope
from paani_sim.worlds.world import Light, Wind, World

Uniforms = dict[str, float | F32]

SWELL_M = np.array([11.3, 4.1, 1.37])  # tiles of the water shader
SWELL_SHARE = np.array([0.55, 0.62, 0.56])  # of the slope in each, of a lake of no known fetch
OPEN_WAVE_M = 1.2  # peak wave whose sea looks like that
RAIN_SLOPE = 0.0012  # mean square slope that rings of rain add per root of mm/h


def uniforms(world: World, light: Light, wind: Wind, sky: Sky) -> Uniforms:
    """Everything that stays the same from picture to picture."""
    sea = wind_sea_state(wind, world.waves)
    square = mean_square_slope(wind.speed_mps) + RAIN_SLOPE * light.rain_mmph**0.5
    return {
        "sun": sky.sun_direction,
        "sunRgb": sky.sun_rgb,
        "skyRgb": sky.ambient_rgb,
        "hazeRgb": sky.horizon_rgb,
        "sunShare": sun_share(sky),
        "visibility": 1.0 / (1.0 / light.visibility_m + extinction_per_m(light.rain_mmph)),
        "windWay": np.array([np.cos(wind.toward_rad), np.sin(wind.toward_rad)], np.float32),
        "slopeRms": float(np.sqrt(square)),
        "swellShare": (_swell_share(sea) if world.waves.fetch_m else SWELL_SHARE).astype(np.float32),
        "bodyRgb": np.asarray(world.water_rgb, np.float32) ** 2,
        "flow": np.zeros(2, np.float32),
        "tilesPerMetre": np.divide(1.0, SPAN_M[1:], dtype=np.float32),
    }


def sun_share(sky: Sky) -> float:
    """How much of the light on level ground comes straight from the sun, 0..1."""
    direct = float(sky.sun_rgb.max()) * max(float(sky.sun_direction[2]), 0.0)
    return direct / (direct + float(sky.ambient_rgb.max()))


def _swell_share(sea: SeaState) -> npt.NDArray[np.float64]:
    """The longer the waves, the more of the slope is in the large tiles; the sum of squares stays."""
    tilt = np.clip(sea.wave_m / OPEN_WAVE_M, 0.35, 2.5) ** np.array([0.6, 0.2, -0.3])
    share = SWELL_SHARE * tilt
    return np.asarray(share * np.sqrt((SWELL_SHARE**2).sum() / (share**2).sum()))
