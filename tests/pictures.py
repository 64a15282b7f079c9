"""Pictures for tests, drawn here: a river, and everything that is no picture of one. BGR uint8 [240, 320, 3]."""

from __future__ import annotations

import cv2
import numpy as np

from paani.arrays import U8

WIDTH, HEIGHT = 320, 240


def river(seed: int = 0) -> U8:
    """Sky, two banks with trees, rippled water, a boat."""
    rng = np.random.default_rng(seed)
    rows = np.linspace(0.0, 1.0, HEIGHT)[:, None, None]
    picture = np.where(rows < 0.4, (220, 190, 160) - 60 * rows, (120, 110, 80) - 50 * rows) * np.ones((1, WIDTH, 1))
    ripples = cv2.resize(rng.normal(0, 1, (HEIGHT // 3, WIDTH // 12)), (WIDTH, HEIGHT), interpolation=cv2.INTER_LINEAR)
    picture += (rows >= 0.4) * 18.0 * ripples[..., None]
    leaves = cv2.resize(rng.normal(0, 1, (HEIGHT // 2, WIDTH // 2)), (WIDTH, HEIGHT), interpolation=cv2.INTER_LINEAR)
    for left, right in ((0, 110), (215, WIDTH)):
        picture[60:110, left:right] = (40, 80, 50) + 25 * leaves[60:110, left:right, None]
    cv2.rectangle(picture, (150, 90), (180, 112), (60, 60, 200), -1)
    cv2.rectangle(picture, (160, 78), (170, 90), (230, 230, 230), -1)
    return noisy(np.clip(picture, 0, 255).astype(np.uint8), 2.0, seed)


def noisy(picture: U8, sigma: float, seed: int = 1) -> U8:
    noise = np.random.default_rng(seed).normal(0.0, sigma, picture.shape)
    return np.clip(picture + noise, 0, 255).astype(np.uint8)


def solid(*bgr: int) -> U8:
    return np.asarray(np.full((HEIGHT, WIDTH, 3), bgr), np.uint8)


def _test_card() -> U8:
    card = solid(0, 0, 0)
    bars = ((255, 255, 255), (0, 255, 255), (255, 255, 0), (0, 255, 0), (255, 0, 255), (0, 0, 255), (255, 0, 0))
    for i, colour in enumerate(bars):
        card[:, i * 40 : (i + 1) * 40] = colour
    return card


def _salted(picture: U8) -> U8:
    where = np.random.default_rng(3).random(picture.shape[:2])
    salted = np.array(picture, np.uint8)
    salted[where < 0.15] = 0
    salted[where > 0.85] = 255
    return salted


def _covered(share: float) -> U8:
    covered = river()
    covered[:, : round(share * WIDTH)] = noisy(solid(14, 12, 12), 1.5)[:, : round(share * WIDTH)]
    return covered


def _scaled(gain: float, offset: float = 0.0) -> U8:
    return np.asarray(np.clip(river() * gain + offset, 0, 255), np.uint8)


PICTURES: dict[str, U8] = {
    "river": river(),
    "river_in_fog": _scaled(0.25, 140.0),
    "river_at_dusk": _scaled(0.3),
    "river_in_light_noise": noisy(river(), 8.0),
    "river_in_strong_noise": noisy(river(), 50.0),
    "black": solid(0, 0, 0),
    "black_with_noise": noisy(solid(3, 3, 3), 3.0),
    "nearly_black": _scaled(1 / 25),
    "white": solid(255, 255, 255),
    "overexposed": _scaled(6.0, 80.0),
    "grey": solid(128, 128, 128),
    "grey_with_noise": noisy(solid(128, 128, 128), 5.0),
    "green": solid(0, 255, 0),
    "test_card": _test_card(),
    "test_card_with_noise": noisy(_test_card(), 8.0),
    "white_noise": np.random.default_rng(2).integers(0, 256, (HEIGHT, WIDTH, 3), np.uint8),
    "salt_and_pepper": _salted(river()),
    "blurred": np.asarray(cv2.GaussianBlur(river(), (0, 0), 10.0), np.uint8),
    "gradient": np.repeat(np.repeat(np.linspace(0, 255, HEIGHT)[:, None, None], WIDTH, 1), 3, 2).astype(np.uint8),
    "covered_60": _covered(0.6),
    "covered_80": _covered(0.8),
}
