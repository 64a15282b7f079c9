"""Rain before the camera and on its lens. Pure; the same time gives the same picture.

Extinction by rain after Atlas (1953): 0.21 R^0.6 per kilometre at R mm/h. Streaks after Garg and Nayar (2007): a drop
falls about half a metre while the shutter is open, and shows the sky's light.
"""

import cv2
import numpy as np

from paani.arrays import F32, U8

PAD_PX = 96
DROP_LIFE_S = 9.0
HEAVY_MMPH = 25.0  # where a lens left in the open is as wet as it gets


def extinction_per_m(rain_mmph: float) -> float:
    """How fast rain takes light out of a ray."""
    return float(0.21e-3 * max(rain_mmph, 0.0) ** 0.6)


class Rain:
    """Streaks and drops for one picture size."""

    def __init__(self, width_px: int, height_px: int, seed: int) -> None:
        self._size = (height_px, width_px)
        self._seed = seed
        self._unit = width_px / 320.0
        rng = np.random.default_rng([seed, 5])
        self._streaks = _streaks(rng, width_px + PAD_PX, height_px + PAD_PX, self._unit)

    def apply(self, bgr: U8, rain_mmph: float, t_s: float) -> U8:
        """The picture through the rain; unchanged where there is none."""
        if rain_mmph <= 0.0:
            return bgr
        height, width = self._size
        stamp = round(t_s * 1000.0)
        down, right = (stamp * 7907) % PAD_PX, (stamp * 104711) % PAD_PX
        veil = self._streaks[down : down + height, right : right + width] * min(1.0, (rain_mmph / 12.0) ** 0.5)
        light = float(np.percentile(bgr[: height // 3 : 4, ::4], 80.0))
        wet = bgr + (light - bgr.astype(np.float32)) * veil[..., None]
        return self._dropped(np.asarray(wet, np.uint8), min(rain_mmph / HEAVY_MMPH, 1.0), t_s)

    def _dropped(self, bgr: U8, wetness: float, t_s: float) -> U8:
        """Drops on the lens: each a small upside-down view of what is around it."""
        height, width = self._size
        out = bgr.copy()
        soft = cv2.blur(bgr, (5, 5))
        for k in range(round(16 * wetness**0.7)):
            life, phase = divmod(t_s / DROP_LIFE_S + k * 0.618, 1.0)
            rng = np.random.default_rng([self._seed, 6, k, int(life)])
            radius = float(rng.gamma(4.0, 1.1)) * self._unit * min(1.0, 6.0 * (1.0 - phase))
            size = round(radius)
            if size < 2:
                continue
            x = int(rng.integers(size, width - size))
            y = int(rng.integers(size, height - size))
            y = min(height - size - 1, round(y + 10.0 * self._unit * phase * rng.random()))
            view = 5 * size
            x0, x1, y0, y1 = max(0, x - view), min(width, x + view), max(0, y - view), min(height, y + view)
            side = 2 * size + 1
            lens = cv2.resize(soft[y0:y1, x0:x1][::-1, ::-1], (side, side), interpolation=cv2.INTER_AREA)
            at = out[y - size : y + size + 1, x - size : x + size + 1]
            ramp = np.linspace(-1.0, 1.0, side)
            reach = np.hypot(ramp[:, None] * 0.85, ramp[None, :])
            alpha = np.clip((1.0 - reach) * 3.0, 0.0, 0.92)[: at.shape[0], : at.shape[1], None]
            rim = (1.08 - 0.35 * reach**3)[: at.shape[0], : at.shape[1], None]
            lit = np.clip(lens[: at.shape[0], : at.shape[1]] * rim, 0.0, 255.0)
            at[:] = np.asarray(at * (1.0 - alpha) + lit * alpha, np.uint8)
        return out


def _streaks(rng: np.random.Generator, width: int, height: int, unit: float) -> F32:
    """How much of each pixel streaks hide, 0..1, drawn far to near."""
    veil = np.zeros((height, width), np.float32)
    for share, length, thick, dark in ((0.010, 9.0, 1, 0.16), (0.0022, 20.0, 1, 0.30), (0.0003, 42.0, 2, 0.34)):
        layer = np.zeros(veil.shape, np.uint8)
        for _ in range(round(share * width * height / unit**2 / 4)):
            x, y = rng.uniform(0, width), rng.uniform(-20, height)
            long = length * unit * rng.uniform(0.6, 1.3)
            lean = rng.normal(0.10, 0.03) * long
            ends = ((round(x), round(y)), (round(x + lean), round(y + long)))
            cv2.line(
                layer, *ends, (round(255 * dark * rng.uniform(0.5, 1.0)),), max(1, round(thick * unit)), cv2.LINE_AA
            )
        veil = np.maximum(veil, layer.astype(np.float32) / 255.0)
    return np.asarray(cv2.GaussianBlur(veil, (0, 0), 0.5), np.float32)
