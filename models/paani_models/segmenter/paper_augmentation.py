"""The paper's augmentation of segmenter pictures, each with its probability: flip, colour jitter, glare (S8).

The generator is seeded, where the paper's glare draws from a new, unseeded one at each call (S12).
"""

from __future__ import annotations

from collections.abc import Collection

import cv2
import numpy as np

from paani.arrays import U8
from paani_models.training.augment import GLARE_FRAC, Rng, add_glare

FLIP_FRAC = 0.5  # S8: share of pictures that are mirrored
JITTER_FRAC = 0.5  # S8: share of pictures whose colours are changed
BRIGHTNESS, CONTRAST, SATURATION = 0.2, 0.2, 0.2  # S8: factors are drawn from 1 - x to 1 + x
HUE = 0.05  # S8: of the whole circle, to either side
HUE_STEPS = 180  # of OpenCV's circle of hues in 8 bits
AUGMENTATIONS = ("flip", "jitter", "glare")


def augment_paper_pair(
    rng: Rng, picture: U8, mask: U8, target_wh: tuple[int, int], without: Collection[str] = ()
) -> tuple[U8, U8]:
    """One training pair of the target size: RGB uint8 [H,W,3] and mask uint8 [H,W], which moves with the picture.

    without: those of AUGMENTATIONS that are left out, to see what each is worth; the others are drawn as with them.
    """
    picture = np.asarray(cv2.resize(picture, target_wh), np.uint8)
    mask = np.asarray(cv2.resize(mask, target_wh, interpolation=cv2.INTER_NEAREST), np.uint8)
    if rng.random() < FLIP_FRAC:
        mirrored = np.ascontiguousarray(picture[:, ::-1]), np.ascontiguousarray(mask[:, ::-1])
        picture, mask = (picture, mask) if "flip" in without else mirrored
    if rng.random() < JITTER_FRAC:
        jittered = jitter_colour_slightly(rng, picture)
        picture = picture if "jitter" in without else jittered
    if rng.random() < GLARE_FRAC:
        lit = add_glare(rng, picture)
        picture = picture if "glare" in without else lit
    return picture, mask


def jitter_colour_slightly(rng: Rng, picture: U8) -> U8:
    """Brightness, contrast about the mean grey, saturation and hue, each within its range."""
    bright, contrast, saturation = (1.0 + rng.uniform(-x, x) for x in (BRIGHTNESS, CONTRAST, SATURATION))
    turn = rng.uniform(-HUE, HUE)
    changed = picture.astype(np.float32) * bright
    grey = float(cv2.cvtColor(np.clip(changed, 0, 255).astype(np.uint8), cv2.COLOR_RGB2GRAY).mean())
    changed = grey + (changed - grey) * contrast
    hsv = cv2.cvtColor(np.clip(changed, 0, 255).astype(np.uint8), cv2.COLOR_RGB2HSV).astype(np.float32)
    hsv[..., 0] = (hsv[..., 0] + turn * HUE_STEPS) % HUE_STEPS
    hsv[..., 1] = np.clip(hsv[..., 1] * saturation, 0, 255)
    return np.asarray(cv2.cvtColor(hsv.astype(np.uint8), cv2.COLOR_HSV2RGB), np.uint8)
