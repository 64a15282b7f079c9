"""Pictures that the image-quality check lets through, drawn here, so that a measurement needs no others."""

import cv2
import numpy as np

from paani.arrays import U8

SIZE_WH = (320, 240)  # A8


def draw_scene(seed: int) -> U8:
    """Sky, textured banks, rippled water: BGR uint8 [240, 320, 3]."""
    rng = np.random.default_rng(seed)
    width, height = SIZE_WH
    level = np.linspace(0.0, 1.0, height)[:, None, None]
    scene = np.where(level < 0.4, (220, 190, 160) - 60 * level, (120, 110, 80) - 50 * level) * np.ones((1, width, 1))
    scene += (level >= 0.4) * 18.0 * cv2.resize(rng.normal(0, 1, (height // 3, width // 12)), SIZE_WH)[..., None]
    leaves = cv2.resize(rng.normal(0, 1, (height // 2, width // 2)), SIZE_WH)[60:110, :, None]
    scene[60:110, : width // 3] = (40, 80, 50) + 25 * leaves[:, : width // 3]
    scene[60:110, -width // 3 :] = (40, 80, 50) + 25 * leaves[:, -width // 3 :]
    return np.clip(scene + rng.normal(0, 2, scene.shape), 0, 255).astype(np.uint8)
