"""Periodic textures of wave slopes and noise, which the water and land shaders sample. Pure numpy."""

import numpy as np
import numpy.typing as npt

TILE = 256
SLOPE_RANGE = 4.0  # stored slopes span +-4 standard deviations


def slope_tile(seed: int, *, spread: float = 1.1) -> npt.NDArray[np.uint8]:
    """`(TILE, TILE, 4)` uint8, periodic: slopes in x and y (unit variance in all), their squares.

    Waves run toward +x within a directional `spread`. Channels 0 and 1 hold
    `0.5 + slope / (2 * SLOPE_RANGE)`; channels 2 and 3 the squares over `SLOPE_RANGE ** 2`,
    so that a smaller mip level still knows the variance it has averaged away.
    """
    rng = np.random.default_rng(seed)
    k = np.fft.fftfreq(TILE, 1.0 / TILE)
    kx, ky = np.meshgrid(k, k)
    size = np.hypot(kx, ky)
    size[0, 0] = 1.0
    angle = np.arctan2(ky, kx)
    shape = np.where((size > 2.5) & (size < 90.0), size**-1.45, 0.0)
    shape = shape * np.exp(-((angle / spread) ** 2))
    phase = np.exp(2j * np.pi * rng.random((TILE, TILE)))
    slopes = [np.real(np.fft.ifft2(shape * phase * 1j * part)) for part in (kx, ky)]
    scale = np.sqrt(np.mean(slopes[0] ** 2 + slopes[1] ** 2))
    x, y = (np.clip(s / scale, -SLOPE_RANGE, SLOPE_RANGE) for s in slopes)
    tile = np.stack(
        [
            0.5 + x / (2 * SLOPE_RANGE),
            0.5 + y / (2 * SLOPE_RANGE),
            (x / SLOPE_RANGE) ** 2,
            (y / SLOPE_RANGE) ** 2,
        ],
        axis=-1,
    )
    return np.round(tile * 255.0).astype(np.uint8)


def noise_tile(seed: int) -> npt.NDArray[np.uint8]:
    """`(TILE, TILE, 4)` uint8, periodic noise around 128, coarse in channel 0 to fine in 3."""
    rng = np.random.default_rng(seed)
    k = np.fft.fftfreq(TILE, 1.0 / TILE)
    size = np.hypot(*np.meshgrid(k, k))
    size[0, 0] = 1.0
    channels = []
    for low, high, power in (
        (1.0, 12.0, 1.0),
        (3.0, 40.0, 1.1),
        (8.0, 90.0, 0.9),
        (30.0, 128.0, 0.3),
    ):
        shape = np.where((size >= low) & (size <= high), size**-power, 0.0)
        field = np.real(np.fft.ifft2(shape * np.exp(2j * np.pi * rng.random((TILE, TILE)))))
        channels.append(0.5 + 0.18 * field / field.std())
    tile = np.clip(np.stack(channels, axis=-1), 0.0, 1.0)
    return np.asarray(np.round(tile * 255.0), np.uint8)


def mean_square_slope(wind_mps: float) -> float:
    """Variance of the sea's slope for the wind (Cox and Munk 1954)."""
    return 0.003 + 0.00512 * wind_mps
