"""Training pictures by the paper's recipe: letterboxed square, HSV, shift, scale, flip, mosaic (S5)."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from paani.arrays import F32
from paani_models.datasets.sources import DETECTOR_CLASSES
from paani_models.detector.data import CELL_PX, BoxedPicture, TrainingExample, warp_example
from paani_models.network_input import PAD_GREY, letterbox_affine
from paani_models.training.augment import Rng


@dataclass(frozen=True)
class Augmentation:
    """The recipe of S5. Its vertical flip, rotation, shear, perspective, mixup, cutmix and copy-paste are all zero.

    `auto_augment` and `erasing` are recorded there beside the rest; they act on whole-picture classification alone.
    """

    hue: float = 0.015
    saturation: float = 0.5
    value: float = 0.3
    translate_frac: float = 0.1
    scale: float = 0.3
    flip_frac: float = 0.5
    mosaic_frac: float = 1.0
    auto_augment: str = "randaugment"
    erasing: float = 0.4


def jitter_hsv(rng: Rng, picture: NDArray[np.uint8], augmentation: Augmentation) -> NDArray[np.uint8]:
    """Hue, saturation and value, each times one plus a random part of its gain."""
    gains = 1.0 + rng.uniform(-1, 1, 3) * (augmentation.hue, augmentation.saturation, augmentation.value)
    levels = np.arange(256)[None] * gains[:, None]
    levels[0] %= 180
    table = np.clip(levels, 0, 255).astype(np.uint8)
    planes = cv2.split(cv2.cvtColor(picture, cv2.COLOR_RGB2HSV))
    shifted = cv2.merge([cv2.LUT(plane, row) for plane, row in zip(planes, table, strict=True)])
    return np.asarray(cv2.cvtColor(shifted, cv2.COLOR_HSV2RGB), np.uint8)


def augment_paper_example(
    rng: Rng, items: list[BoxedPicture], target_wh: tuple[int, int], augmentation: Augmentation
) -> TrainingExample:
    """Augment one picture, or a mosaic of four, into a training example."""
    example = (
        _mosaic(rng, items, target_wh, augmentation)
        if len(items) == 4
        else _transform_single(rng, items[0], target_wh, augmentation)
    )
    return TrainingExample(jitter_hsv(rng, example.picture, augmentation), example.boxes, example.exhaustive_mask)


def _transform_single(
    rng: Rng, item: BoxedPicture, target_wh: tuple[int, int], augmentation: Augmentation
) -> TrainingExample:
    fit = letterbox_affine((item.picture.shape[1], item.picture.shape[0]), target_wh)
    moved = _random_scale_and_shift(rng, np.array(target_wh) / 2, target_wh, augmentation)
    return warp_example(item, _compose_affine(_flip_randomly(rng, fit, target_wh[0], augmentation), moved), target_wh)


def _mosaic(
    rng: Rng, items: list[BoxedPicture], target_wh: tuple[int, int], augmentation: Augmentation
) -> TrainingExample:
    """Four pictures that meet in a random point of a canvas of twice the size, seen through the random shift."""
    size = np.array(target_wh, np.float64)
    meet = rng.uniform(0.5, 1.5, 2) * size
    moved = _random_scale_and_shift(rng, size, target_wh, augmentation)
    picture = np.full((target_wh[1], target_wh[0], 3), PAD_GREY, np.uint8)
    exhaustive_mask = np.ones((len(DETECTOR_CLASSES), target_wh[1] // CELL_PX, target_wh[0] // CELL_PX), np.bool_)
    boxes = []
    for item, (right, below) in zip(items, ((0, 0), (1, 0), (0, 1), (1, 1)), strict=True):
        source = np.array(item.picture.shape[1::-1], np.float64)
        scale = float((size / source).min())
        corner = meet - (1 - np.array((right, below))) * source * scale
        fit = np.array([[scale, 0, corner[0]], [0, scale, corner[1]]], np.float32)
        inner = (max(1, round(source[0] * scale)), max(1, round(source[1] * scale)))
        if rng.random() < augmentation.flip_frac:
            fit = np.array([[-scale, 0, corner[0] + inner[0]], [0, scale, corner[1]]], np.float32)
        part = warp_example(item, _compose_affine(fit, moved), target_wh)
        low = np.clip(np.round(moved[:, :2] @ corner + moved[:, 2]), 0, target_wh).astype(int)
        high = np.clip(np.round(moved[:, :2] @ (corner + inner) + moved[:, 2]), 0, target_wh).astype(int)
        picture[low[1] : high[1], low[0] : high[0]] = part.picture[low[1] : high[1], low[0] : high[0]]
        exhaustive_mask &= part.exhaustive_mask
        boxes.append(part.boxes)
    return TrainingExample(picture, np.vstack(boxes), exhaustive_mask)


def _random_scale_and_shift(
    rng: Rng, centre: NDArray[np.float64], target_wh: tuple[int, int], augmentation: Augmentation
) -> F32:
    """Scale about a point and shift it to near the target's centre, both at random."""
    scale = 1.0 + rng.uniform(-1, 1) * augmentation.scale
    middle = (0.5 + rng.uniform(-1, 1, 2) * augmentation.translate_frac) * target_wh
    return np.array([[scale, 0, middle[0] - scale * centre[0]], [0, scale, middle[1] - scale * centre[1]]], np.float32)


def _flip_randomly(rng: Rng, affine: F32, width_px: int, augmentation: Augmentation) -> F32:
    if rng.random() >= augmentation.flip_frac:
        return affine
    return np.array([[-affine[0, 0], 0, width_px - affine[0, 2]], affine[1]], np.float32)


def _compose_affine(first: F32, second: F32) -> F32:
    """Compose two affine maps: `first`, then `second`."""
    linear = second[:, :2] @ first[:, :2]
    return np.hstack([linear, (second[:, :2] @ first[:, 2] + second[:, 2])[:, None]]).astype(np.float32)
