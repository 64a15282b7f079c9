"""The sky as one panorama, painted from noise. Pure numpy.

`u` runs with azimuth counter-clockwise from east, `v` with the square root of sin(elevation),
so that the low sky, most of every picture, gets most of the rows.
"""

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from paani.arrays import F32
from paani_sim.worlds.world import Light

WIDTH = 1024
HEIGHT = 192
SKIES = ("clear", "cloudy", "overcast", "dusk", "hazy")


@dataclass(frozen=True, eq=False)
class Sky:
    """Panorama `(HEIGHT, WIDTH, 3)` uint8 RGB (display values) and what it lights with (linear)."""

    panorama: npt.NDArray[np.uint8]
    sun_direction: F32
    sun_rgb: F32
    ambient_rgb: F32
    horizon_rgb: F32


@dataclass(frozen=True)
class _Palette:
    zenith: tuple[float, float, float]
    horizon: tuple[float, float, float]
    cloud: tuple[float, float, float]
    shade: tuple[float, float, float]
    cover: float
    softness: float
    sun: tuple[float, float, float]
    ambient: float


_PALETTES = {
    "clear": _Palette(
        (0.20, 0.42, 0.78),
        (0.72, 0.83, 0.93),
        (0.97, 0.97, 0.98),
        (0.78, 0.81, 0.86),
        0.22,
        0.30,
        (2.6, 2.4, 2.05),
        0.62,
    ),
    "cloudy": _Palette(
        (0.27, 0.48, 0.80),
        (0.78, 0.86, 0.93),
        (0.98, 0.98, 0.97),
        (0.60, 0.64, 0.70),
        0.52,
        0.26,
        (2.1, 1.95, 1.7),
        0.74,
    ),
    "overcast": _Palette(
        (0.60, 0.64, 0.69),
        (0.84, 0.86, 0.88),
        (0.88, 0.89, 0.90),
        (0.56, 0.59, 0.63),
        0.95,
        0.65,
        (0.35, 0.35, 0.34),
        1.0,
    ),
    "dusk": _Palette(
        (0.26, 0.36, 0.58),
        (0.96, 0.72, 0.46),
        (0.98, 0.80, 0.62),
        (0.50, 0.42, 0.46),
        0.45,
        0.35,
        (1.9, 1.2, 0.62),
        0.50,
    ),
    "hazy": _Palette(
        (0.60, 0.70, 0.80),
        (0.90, 0.90, 0.87),
        (0.95, 0.95, 0.93),
        (0.80, 0.82, 0.83),
        0.40,
        0.8,
        (1.2, 1.15, 1.05),
        0.85,
    ),
}


def paint_sky(light: Light) -> Sky:
    """Paint the sky for `light`. Raises KeyError for a sky that is not in `SKIES`."""
    palette = _PALETTES[light.sky]
    azimuth = (np.arange(WIDTH) + 0.5) / WIDTH * 2.0 * np.pi
    up = ((np.arange(HEIGHT) + 0.5) / HEIGHT) ** 2
    flat = np.sqrt(1.0 - up**2)
    ray = np.stack(
        [
            flat[:, None] * np.cos(azimuth),
            flat[:, None] * np.sin(azimuth),
            np.broadcast_to(up[:, None], (HEIGHT, WIDTH)),
        ],
        axis=-1,
    ).astype(np.float32)
    sun = np.array(
        [
            np.cos(light.sun_elevation_rad) * np.cos(light.sun_azimuth_rad),
            np.cos(light.sun_elevation_rad) * np.sin(light.sun_azimuth_rad),
            np.sin(light.sun_elevation_rad),
        ],
        np.float32,
    )
    toward = np.clip(ray @ sun, 0.0, 1.0)[..., None]
    rise = (up[:, None, None] ** 0.55).astype(np.float32)
    zenith, horizon = np.asarray(palette.zenith), np.asarray(palette.horizon)
    colour = horizon * (1.0 - rise) + zenith * rise
    glow = np.asarray(palette.sun) / max(palette.sun)
    bright = 1.0 if light.sky != "overcast" else 0.35
    colour = colour + bright * glow * (0.10 * toward**6 + 0.30 * toward**40)
    cover = _clouds(ray, light.seed, palette.cover, palette.softness)
    lit = _clouds(ray + 0.05 * sun, light.seed, palette.cover, palette.softness)
    thick = np.clip(cover * 1.2 - 0.25 + 0.9 * (lit - cover), 0.0, 1.0)[..., None]
    cloud = np.asarray(palette.cloud) * (1.0 - thick) + np.asarray(palette.shade) * thick
    cloud = cloud + bright * glow * 0.22 * toward**8
    fade = np.clip(up[:, None, None] / 0.10, 0.12, 1.0)
    colour = colour + (cloud - colour) * cover[..., None] * fade * 0.95
    panorama = np.clip(colour * 255.0, 0, 255).astype(np.uint8)
    mean = (np.asarray(colour, float) ** 2 * up[:, None, None]).mean(axis=(0, 1)) / up.mean()
    low = np.clip(sun[2] / 0.25, 0.25, 1.0)
    return Sky(
        panorama=panorama,
        sun_direction=sun,
        sun_rgb=(np.asarray(palette.sun) * low).astype(np.float32),
        ambient_rgb=(mean * palette.ambient).astype(np.float32),
        horizon_rgb=(np.clip(horizon, 0.0, 1.0) ** 2).astype(np.float32),
    )


def _clouds(ray: F32, seed: int, cover: float, softness: float) -> F32:
    """Cloud density 0..1 of a flat deck seen in perspective."""
    rng = np.random.default_rng(seed)
    plane = ray[..., :2] / (np.maximum(ray[..., 2:], 0.0) + 0.16)
    total = np.zeros(ray.shape[:2], np.float32)
    weight = 0.0
    for octave in range(5):
        tile = rng.random((64, 64)).astype(np.float32)
        tile = np.tile(tile, (2, 2))
        scale, gain = 3.1 * 2.03**octave, 0.56**octave
        at = (plane * scale) % 64.0
        total += gain * cv2.remap(tile, at[..., 0].astype(np.float32), at[..., 1].astype(np.float32), cv2.INTER_LINEAR)
        weight += gain
    density = (total / weight - (0.78 - 0.52 * cover)) / (0.12 + 0.35 * softness)
    return np.asarray(np.clip(density, 0.0, 1.0), np.float32)
