"""Effects of a small camera on a picture: softness, motion, vignette, white balance, sensor noise. Deterministic."""

import cv2
import numpy as np
import numpy.typing as npt

from paani.arrays import U8

NEUTRAL = (1.0, 1.0, 1.0)
SHORTEST_PX = 0.7  # a shorter smear is invisible


class Lens:
    """Effects for one picture size; the noise is a fixed tile, shifted by `stamp`. `balance` is the gain of b, g, r."""

    def __init__(self, width_px: int, height_px: int, seed: int, balance: tuple[float, float, float] = NEUTRAL) -> None:
        x = np.linspace(-1.0, 1.0, width_px)[None, :]
        y = np.linspace(-0.75, 0.75, height_px)[:, None]
        gain = 1.0 - 0.16 * (x**2 + y**2)
        self._gain = (gain[..., None] * np.asarray(balance)).astype(np.float32)
        rng = np.random.default_rng([seed, 2])
        noise = rng.normal(0.0, 1.5, (height_px + 64, width_px + 64, 1))
        noise = noise + rng.normal(0.0, 0.8, (height_px + 64, width_px + 64, 3))
        self._noise = noise.astype(np.float32)
        self._size = (height_px, width_px)

    def apply(self, bgr: U8, stamp: int, *, blur_px: float = 0.45, smear_px: float = 0.0) -> U8:
        """The picture as the camera delivers it; it moved `smear_px` to the side while it was exposed."""
        down, right = (stamp * 7919) % 64, (stamp * 104729) % 64
        noise = self._noise[down : down + self._size[0], right : right + self._size[1]]
        soft = cv2.GaussianBlur(bgr, (3, 3), blur_px)
        if abs(smear_px) > SHORTEST_PX:
            soft = cv2.filter2D(soft, -1, _streak(abs(smear_px)))
        out = cv2.multiply(soft, self._gain, dtype=cv2.CV_32F)
        out = cv2.add(out, noise)
        result: U8 = np.clip(out, 0.0, 255.0).astype(np.uint8)
        return result


def _streak(length_px: float) -> npt.NDArray[np.float32]:
    """A row of weights that spreads a pixel over `length_px`."""
    half = int(np.ceil(0.5 * (length_px - 1.0)))
    row = np.clip(0.5 * (length_px + 1.0) - np.abs(np.arange(-half, half + 1)), 0.0, 1.0)
    return np.asarray(row / row.sum(), np.float32)[None, :]
