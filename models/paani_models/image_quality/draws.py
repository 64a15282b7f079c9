"""Training examples of the image-quality network: every epoch corrupts the scenes anew, by faults drawn at random.

Faults are drawn in proportion to the network's recent error on them (hard example mining).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from paani.arrays import U8
from paani.picture_faults import apply_fault, crop_above_water
from paani_models.image_quality.data import MIDDLE_WH, FaultLevel, Scene
from paani_models.image_quality.network import INPUT_HEIGHT_PX, INPUT_WIDTH_PX
from paani_models.training.augment import crop_land

CLEAN, WITHOUT_WATER = -1, -2  # in place of the index of a fault level
CROPPED_FRAC, MIN_CROP_FRAC = 0.6, 0.8  # share of scenes that are cropped, and the least that a crop keeps of each side
MIN_VIEW_FRAC = 0.5  # the least that a crop of a view without water keeps of each side
Rng = np.random.Generator


class FitnessExample(NamedTuple):
    """Network input uint8 [3,120,160], target fitness, and content: a fault level's index, CLEAN or WITHOUT_WATER."""

    picture: U8
    target: float
    content: int


def draw_epoch_plan(count: int, weights: NDArray[np.float64], per_scene: int, rng: Rng) -> NDArray[np.int64]:
    """Draw the content of one epoch of `count` scenes, shuffled: int64 [N,2], scene index and content.

    Each scene is content once as it is, once in a view without water, and with `per_scene` faults, drawn by weight.
    """
    rows = []
    for index in range(count):
        drawn = rng.choice(len(weights), per_scene, replace=False, p=weights / weights.sum())
        rows += [(index, CLEAN), (index, WITHOUT_WATER), *((index, int(level)) for level in drawn)]
    return rng.permutation(np.array(rows, np.int64))


def draw_example(
    scene: Scene, content: int, levels: Sequence[FaultLevel], rng: Rng, vary: bool = True
) -> FitnessExample:
    """Make one example. A scene that allows no view without water shows a fault instead.

    vary: mirror, crop and brighten or darken it at random. A scene without water is unfit as it is and with any fault.
    """
    picture, mask = _vary_scene(scene, rng) if vary else (scene.picture, scene.mask)
    if scene.is_without_water:
        if content >= 0:
            picture, _ = apply_fault(levels[content].fault, picture, mask, levels[content].severity, rng)
        return FitnessExample(to_network_planes(picture), 0.0, WITHOUT_WATER)
    if content == WITHOUT_WATER:
        view = _crop_without_water(picture, mask, rng)
        if view is not None:
            return FitnessExample(to_network_planes(view), 0.0, WITHOUT_WATER)
        content = int(rng.integers(len(levels)))
    if content == CLEAN:
        return FitnessExample(to_network_planes(picture), 1.0, CLEAN)
    level = levels[content]
    return FitnessExample(
        to_network_planes(apply_fault(level.fault, picture, mask, level.severity, rng)[0]), level.target, content
    )


def to_network_planes(bgr: U8) -> U8:
    """BGR uint8 [240,320,3] -> RGB uint8 [3,120,160]."""
    small = cv2.resize(bgr, (INPUT_WIDTH_PX, INPUT_HEIGHT_PX), interpolation=cv2.INTER_AREA)
    return np.ascontiguousarray(small[:, :, ::-1].transpose(2, 0, 1))


def _vary_scene(scene: Scene, rng: Rng) -> tuple[U8, U8]:
    picture, mask = scene.picture, scene.mask
    if rng.random() < 0.5:
        picture, mask = picture[:, ::-1], mask[:, ::-1]
    if rng.random() < CROPPED_FRAC:
        part = _random_part(rng, MIN_CROP_FRAC)
        picture = np.asarray(cv2.resize(picture[part], MIDDLE_WH), np.uint8)
        mask = np.asarray(cv2.resize(mask[part], MIDDLE_WH, interpolation=cv2.INTER_NEAREST), np.uint8)
    picture = cv2.convertScaleAbs(picture, alpha=float(rng.uniform(0.85, 1.15)))
    return np.ascontiguousarray(picture), np.ascontiguousarray(mask)


def _random_part(rng: Rng, least: float) -> tuple[slice, slice]:
    """Rows and columns of a part that is at least that share of the picture each way."""
    width, height = MIDDLE_WH
    w, h = (round(size * float(rng.uniform(least, 1.0))) for size in MIDDLE_WH)
    x, y = int(rng.integers(width - w + 1)), int(rng.integers(height - h + 1))
    return slice(y, y + h), slice(x, x + w)


def _crop_without_water(picture: U8, mask: U8, rng: Rng) -> U8 | None:
    """A view without water: all that is above it, a part of that, or land alone."""
    view = crop_above_water(picture, mask)
    kind = rng.random()
    if view is not None and kind < 0.4:
        return view
    if view is not None and kind < 0.7:
        return np.asarray(cv2.resize(view[_random_part(rng, MIN_VIEW_FRAC)], MIDDLE_WH), np.uint8)
    part = crop_land(rng, picture, mask)
    if part is None:
        return view
    return np.asarray(cv2.resize(part[0], MIDDLE_WH, interpolation=cv2.INTER_LINEAR), np.uint8)
