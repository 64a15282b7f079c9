"""Painted plants: one RGBA layer per plant, for cards that turn towards the camera. Pure.

Every layer is `(SIZE, SIZE, 4)` uint8 RGBA, foot at the bottom edge, light from the upper left.
"""

import cv2
import numpy as np
import numpy.typing as npt

from paani.arrays import U8

SIZE = 256
Tone = tuple[float, float, float]

BROADLEAF = (0, 1, 2, 3, 4)
CONIFER = (5, 6)
POPLAR = (7,)
WILLOW = (8,)
BUSH = (9, 10, 11)
REED = (12, 13)
WOOD_EDGE = (14, 15)


def paint_sprites(seed: int, season: float = 0.0) -> U8:
    """All layers `(16, SIZE, SIZE, 4)`; `season` 0 is summer green, 1 is autumn."""
    rng = np.random.default_rng(seed)
    layers = []
    for k in range(5):
        layers.append(_broadleaf(rng, _leaf_tone(rng, season), 0.75 + 0.06 * k))
    layers += [_conifer(rng, (0.17, 0.20, 0.11)), _conifer(rng, (0.20, 0.24, 0.13))]
    layers.append(_broadleaf(rng, _leaf_tone(rng, season), 0.34, tall=True))
    layers.append(_willow(rng, (0.40, 0.45, 0.20)))
    layers += [_bush(rng, _leaf_tone(rng, 0.5 * season)) for _ in range(3)]
    layers += [_reeds(rng, (0.52, 0.54, 0.28)), _reeds(rng, (0.42, 0.52, 0.22))]
    layers += [_wood_edge(rng, season), _wood_edge(rng, season)]
    return np.stack(layers)


def _leaf_tone(rng: np.random.Generator, season: float) -> Tone:
    green = np.array([0.33, 0.38, 0.17]) + rng.normal(0.0, 0.03, 3) * [1.2, 0.8, 0.6]
    autumn = np.array([0.58, 0.36, 0.12]) + rng.normal(0.0, 0.05, 3)
    mix = season * rng.uniform(0.3, 1.0)
    red, g, b = np.clip((1.0 - mix) * green + mix * autumn, 0.05, 0.9)
    return float(red), float(g), float(b)


class _Canvas:
    """Colour and alpha that leaves are dabbed onto, back to front."""

    def __init__(self, tone: Tone) -> None:
        dark = [round(255 * 0.55 * c) for c in tone]
        self.rgba = np.zeros((SIZE, SIZE, 4), np.uint8)
        self.rgba[..., :3] = dark

    def dabs(
        self,
        x: npt.NDArray[np.float64],
        y: npt.NDArray[np.float64],
        radius: npt.NDArray[np.float64],
        rgb: npt.NDArray[np.float64],
        lean: float = 1.0,
    ) -> None:
        """Small ellipses at `x, y` pixels with colours 0..1, in the given order."""
        colours = np.clip(rgb * 255.0, 0, 255).astype(int)
        ink = np.column_stack([colours, np.full(len(colours), 255)]).tolist()
        centres = (np.column_stack([x, y]) * 16).astype(int) / 16
        along, across = (np.maximum(1, each.astype(int)) / 8 for each in (radius * 16, radius * 16 * 0.6 * lean))
        turn = np.abs(np.sin(x * 12.9898 + y * 78.233)) * 180.0
        for centre, size, angle, colour in zip(
            centres.tolist(), np.column_stack([along, across]).tolist(), turn.tolist(), ink, strict=True
        ):
            cv2.ellipse(self.rgba, (centre, size, angle), colour, -1, cv2.LINE_8)

    def line(self, start: tuple[float, float], end: tuple[float, float], width: float, rgb: Tone) -> None:
        """One straight stroke."""
        ink = (*(round(255 * c) for c in rgb), 255)
        cv2.line(
            self.rgba,
            (round(start[0]), round(start[1])),
            (round(end[0]), round(end[1])),
            ink,
            max(1, round(width)),
            cv2.LINE_8,
        )

    def finish(self) -> U8:
        """The layer, its edge colours bled outwards so that small versions keep no dark rim."""
        rgb, alpha = self.rgba[..., :3].astype(np.float32), self.rgba[..., 3:].astype(np.float32)
        weight = alpha / 255.0
        for reach in (5, 21, 61):
            spread = cv2.GaussianBlur(weight, (0, 0), reach / 3.0)[..., None]
            colour = cv2.GaussianBlur(rgb * weight, (0, 0), reach / 3.0)
            fill = colour / np.maximum(spread, 1e-4)
            known = np.clip(spread * 4.0, 0.0, 1.0)
            rgb = np.where(weight > 0.5, rgb, known * fill + (1.0 - known) * rgb)
        layer: U8 = np.concatenate([rgb, alpha], axis=2).clip(0, 255).astype(np.uint8)
        return layer


def _clump(
    rng: np.random.Generator,
    canvas: _Canvas,
    centre: tuple[float, float],
    radius: float,
    tone: Tone,
    light: float,
    count: int,
    leaf: float,
) -> None:
    """A ball of leaves lit from the upper left."""
    angle = rng.uniform(0.0, 2.0 * np.pi, count)
    reach = np.sqrt(rng.uniform(0.0, 1.0, count)) * rng.uniform(0.8, 1.12, count)
    x, y = reach * np.cos(angle), reach * np.sin(angle) * 0.82
    shade = 0.60 + 0.46 * np.clip(-0.5 * x - 0.75 * y, -1.0, 1.0) + rng.normal(0.0, 0.17, count)
    order = np.argsort(shade + rng.normal(0.0, 0.2, count))
    rgb = np.asarray(tone)[None] * (light * np.clip(shade, 0.15, 1.5))[:, None] * 1.45
    rgb = rgb * (1.0 + rng.normal(0.0, 0.06, (count, 3)))
    size = rng.uniform(0.6, 1.3, count) * leaf
    canvas.dabs((centre[0] + radius * x)[order], (centre[1] + radius * y)[order], size[order], rgb[order])


def _broadleaf(rng: np.random.Generator, tone: Tone, spread: float, *, tall: bool = False) -> U8:
    canvas = _Canvas(tone)
    foot_y, crown_y = SIZE - 1, (0.52 if tall else 0.42) * SIZE
    middle = 0.5 * SIZE
    bark: Tone = (0.22, 0.18, 0.14)
    canvas.line((middle, foot_y), (middle + rng.normal(0, 4), crown_y), 9, bark)
    for _ in range(5):
        start_y = rng.uniform(0.45, 0.72) * SIZE
        canvas.line((middle, start_y), (middle + rng.normal(0, 45 * spread), start_y - 50), 4, bark)
    balls = []
    for _ in range(58 if not tall else 40):
        angle, reach = rng.uniform(0, 2 * np.pi), np.sqrt(rng.uniform(0, 1))
        x = middle + reach * np.cos(angle) * 0.40 * SIZE * spread
        y = crown_y + reach * np.sin(angle) * (0.40 if tall else 0.33) * SIZE
        balls.append((float(x), float(y), float(rng.uniform(14, 28) * (0.8 if tall else 1.0))))
    balls.sort(key=lambda b: -b[1])
    for x, y, r in balls:
        depth = 0.72 + 0.42 * (1.0 - y / SIZE) - 0.10 * (x - middle) / (0.4 * SIZE)
        _clump(rng, canvas, (x, y), r, tone, depth, 150, 1.9)
    return canvas.finish()


def _conifer(rng: np.random.Generator, tone: Tone) -> U8:
    canvas = _Canvas(tone)
    canvas.line((128, 255), (128, 40), 5, (0.20, 0.15, 0.12))
    for level in np.linspace(0.0, 1.0, 26)[::-1]:
        y, half = 8 + level * 236, 6 + 62 * level * rng.uniform(0.8, 1.1)
        count = int(24 + 60 * level)
        x = 128 + rng.uniform(-1, 1, count) * half
        droop = np.abs(x - 128) * 0.32
        shade = 0.55 + 0.5 * rng.uniform(0, 1, count) - 0.25 * (x - 128) / max(half, 1.0)
        rgb = np.asarray(tone)[None] * shade[:, None] * 1.7
        canvas.dabs(x, y + droop + rng.normal(0, 2, count), np.full(count, 3.4), rgb, 0.7)
    return canvas.finish()


def _willow(rng: np.random.Generator, tone: Tone) -> U8:
    canvas = _Canvas(tone)
    canvas.line((128, 255), (124, 110), 12, (0.25, 0.20, 0.15))
    for _ in range(30):
        angle, reach = rng.uniform(0, 2 * np.pi), np.sqrt(rng.uniform(0, 1))
        centre = (128 + reach * np.cos(angle) * 84, 80 + reach * np.sin(angle) * 54)
        _clump(rng, canvas, centre, 22, tone, 0.75, 90, 1.9)
    for k in range(420):
        x, y = 128 + rng.normal(0.0, 0.5) * 100, 50 + rng.uniform(0, 120)
        if abs(x - 128) > 112:
            continue
        length = rng.uniform(20, 110) * (1.0 - 0.3 * abs(x - 128) / 112)
        shade = (0.45 + 0.55 * k / 420) * rng.uniform(0.6, 1.35)
        rgb: Tone = (tone[0] * shade, tone[1] * shade, tone[2] * shade)
        canvas.line((x, y), (x + rng.normal(0, 4), min(250.0, y + length)), 1 + k % 2, rgb)
    return canvas.finish()


def _bush(rng: np.random.Generator, tone: Tone) -> U8:
    canvas = _Canvas(tone)
    balls = [(128 + rng.uniform(-1, 1) * 92, 255 - rng.uniform(10, 150) ** 1.0, rng.uniform(18, 36)) for _ in range(48)]
    balls = [b for b in balls if abs(b[0] - 128) < 120 * np.sqrt(max(0.1, b[1] / 255.0))]
    for x, y, r in sorted(balls, key=lambda b: b[1]):
        _clump(rng, canvas, (float(x), float(y)), float(r), tone, 0.8, 190, 2.2)
    return canvas.finish()


def _reeds(rng: np.random.Generator, tone: Tone) -> U8:
    canvas = _Canvas(tone)
    for k in range(170):
        x = rng.uniform(14, 242)
        height = rng.uniform(90, 235) * (1.0 - 0.35 * (abs(x - 128) / 128) ** 2)
        shade = (0.55 + 0.6 * k / 170) * rng.uniform(0.75, 1.2)
        rgb: Tone = (tone[0] * shade, tone[1] * shade, tone[2] * shade)
        tip = (x + rng.normal(0, 16), 255 - height)
        canvas.line((x, 255), tip, 2 if k % 3 else 3, rgb)
        if k % 9 == 0:
            canvas.line(tip, (tip[0], tip[1] + 16), 4, (0.34, 0.22, 0.12))
    return canvas.finish()


def _wood_edge(rng: np.random.Generator, season: float) -> U8:
    """A stretch of wood seen from afar."""
    canvas = _Canvas((0.16, 0.22, 0.10))
    cv2.rectangle(canvas.rgba, (24, 190), (231, 255), (44, 54, 30, 255), -1)
    for row in range(3):
        for _ in range(13):
            x = rng.uniform(26, 230)
            top = rng.uniform(34, 100) + 34 * row + 70 * (abs(x - 128) / 128) ** 3
            tone = _leaf_tone(rng, season)
            for _ in range(5):
                centre = (x + rng.normal(0, 13), top + rng.uniform(0, 90))
                _clump(rng, canvas, centre, rng.uniform(12, 22), tone, 0.66 + 0.1 * row, 70, 2.3)
    return canvas.finish()
