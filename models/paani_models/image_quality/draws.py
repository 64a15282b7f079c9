"""What the gate's training shows: every epoch draws its pictures anew from the scenes and the faults."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from paani.arrays import U8
from paani.picture_faults import above_water, spoilt
from paani_models.image_quality.data import MIDDLE_WH, FaultLevel, Scene
from paani_models.image_quality.network import INPUT_HEIGHT_PX, INPUT_WIDTH_PX
from paani_models.training.augment import crop_land

CLEAN, DRY = -1, -2  # beside the numbers of cells
CROPPED_FRAC, MIN_CROP_FRAC, MIN_VIEW_FRAC = 0.6, 0.8, 0.5
Rng = np.random.Generator


class FitnessExample(NamedTuple):
    """Net input uint8 [3,120,160], what the net should say of it, and what it shows: a cell's number, CLEAN or DRY."""

    picture: U8
    target: float
    shown: int


def draw_epoch_plan(count: int, weights: NDArray[np.float64], per_scene: int, rng: Rng) -> NDArray[np.int64]:
    """What one epoch shows of `count` scenes, shuffled: int64 [N,2], scene and cell.

    Each scene once as it is, once without water, and in `per_scene` cells, drawn by their weights.
    """
    rows = []
    for index in range(count):
        drawn = rng.choice(len(weights), per_scene, replace=False, p=weights / weights.sum())
        rows += [(index, CLEAN), (index, DRY), *((index, int(cell)) for cell in drawn)]
    return rng.permutation(np.array(rows, np.int64))


def draw_example(scene: Scene, shown: int, cells: Sequence[FaultLevel], rng: Rng, vary: bool = True) -> FitnessExample:
    """One picture. A scene without any dry view shows a fault instead. vary: mirrored, cropped, brighter or darker.

    A dry scene is unfit as it is, and with any fault.
    """
    picture, mask = _vary_scene(scene, rng) if vary else (scene.picture, scene.mask)
    if scene.without_water:
        if shown >= 0:
            picture, _ = spoilt(cells[shown].fault, picture, mask, cells[shown].severity, rng)
        return FitnessExample(to_network_planes(picture), 0.0, DRY)
    if shown == DRY:
        dry = _crop_without_water(picture, mask, rng)
        if dry is not None:
            return FitnessExample(to_network_planes(dry), 0.0, DRY)
        shown = int(rng.integers(len(cells)))
    if shown == CLEAN:
        return FitnessExample(to_network_planes(picture), 1.0, CLEAN)
    cell = cells[shown]
    return FitnessExample(
        to_network_planes(spoilt(cell.fault, picture, mask, cell.severity, rng)[0]), cell.target, shown
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
    view = above_water(picture, mask)
    kind = rng.random()
    if view is not None and kind < 0.4:
        return view
    if view is not None and kind < 0.7:
        return np.asarray(cv2.resize(view[_random_part(rng, MIN_VIEW_FRAC)], MIDDLE_WH), np.uint8)
    part = crop_land(rng, picture, mask)
    if part is None:
        return view
    return np.asarray(cv2.resize(part[0], MIDDLE_WH, interpolation=cv2.INTER_LINEAR), np.uint8)
