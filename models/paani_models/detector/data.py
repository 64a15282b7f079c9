"""Training pictures of the detector: letterbox, mosaic (Bochkovskiy et al. 2020), close-ups, and exhaustive masks.

Ours: no source boxes every class. The exhaustive mask says for each class where everything of it is boxed, and only
there may a background candidate be penalised for that class.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from paani.arrays import F32
from paani.errors import UserError
from paani_models.datasets.sources import DETECTOR_CLASSES, Sample, Source, read_boxes, read_mask, read_picture
from paani_models.network_input import PAD_GREY, letterbox_affine
from paani_models.training.augment import GLARE_FRAC, Rng, add_glare, degrade_picture, jitter_colour

LONG_SIDE_PX = 480  # to which larger pictures are shrunk in memory
CELL_PX = 8  # the finest stride of the detector
MIN_SIDE_PX = 3.0  # a box with a shorter side after the warp is dropped
MIN_VISIBLE_FRAC = 0.35  # and one of which less remains in view
PSEUDO_PERSON_MIN_SCORE = 0.5  # of persons that another detector boxed
SMALL_PX, SMALL_FRAC = 12.0, 0.4  # shorter side of a small object; share of pictures that zoom in on one
CLOSE_UP_PX, CLOSE_UP_ZOOM = (5.0, 24.0), 4.0  # shorter side that it is brought to; the largest zoom
WATER, OBSTACLE, SKY = 0, 1, 2  # D6


@dataclass(frozen=True)
class BoxedPicture:
    """RGB picture [H,W,3]; boxes float32 [n,5] (class, corners, normalised); exhaustive_mask uint8 [4] or [4,H,W]."""

    source: str
    picture: NDArray[np.uint8]
    boxes: NDArray[np.float32]
    exhaustive_mask: NDArray[np.uint8]


@dataclass(frozen=True)
class TrainingExample:
    """RGB [H,W,3], boxes float32 [n,5] (class, corners in pixels), exhaustive_mask bool [4, H/8, W/8]."""

    picture: NDArray[np.uint8]
    boxes: NDArray[np.float32]
    exhaustive_mask: NDArray[np.bool_]


def read_boxed(sample: Sample) -> BoxedPicture:
    """Read a labelled picture, or one with only a mask, which says where nothing floats.

    Raises UserError naming an unreadable file.
    """
    rgb = read_picture(sample.picture)
    shrink = LONG_SIDE_PX / max(rgb.shape[:2])
    if shrink < 1.0:
        rgb = np.asarray(cv2.resize(rgb, None, fx=shrink, fy=shrink, interpolation=cv2.INTER_AREA), np.uint8)
    if sample.label is not None:
        annotated = [kind in sample.source.annotated for kind in DETECTOR_CLASSES]
        boxes = np.vstack([read_boxes(sample.label), _pseudo_persons(sample)])
        return BoxedPicture(sample.source.name, rgb, boxes, np.array(annotated, np.uint8))
    if sample.mask is None:
        raise UserError(f"{sample.picture}: has neither boxes nor a mask")
    return BoxedPicture(
        sample.source.name,
        rgb,
        np.zeros((0, 5), np.float32),
        exhaustive_mask_from_classes(sample.source, read_mask(sample.mask), rgb),
    )


def exhaustive_mask_from_classes(
    source: Source, mask: NDArray[np.uint8], picture: NDArray[np.uint8]
) -> NDArray[np.uint8]:
    """Build the exhaustive mask of a picture without boxes: uint8 [4,H,W] of its size, 1 where it shows no such class.

    Nothing of any class is in water or sky, a little inside their edge, nor on the boat's own hull; nothing of the
    classes in `source.empty_of` is anywhere.
    """
    size = (picture.shape[1], picture.shape[0])
    labels = np.asarray(cv2.resize(mask, size, interpolation=cv2.INTER_NEAREST), np.uint8)
    empty = cv2.erode(np.isin(labels, (WATER, SKY)).astype(np.uint8), np.ones((9, 9), np.uint8), borderValue=1)
    if source.own_hull:
        _, components = cv2.connectedComponents((labels == OBSTACLE).astype(np.uint8))
        hull = components[-1, components.shape[1] // 2]
        empty = np.where((components == hull) & (hull > 0), 1, empty)
    return np.stack([np.ones_like(labels) if kind in source.empty_of else empty for kind in DETECTOR_CLASSES]).astype(
        np.uint8
    )


def read_boxed_pictures(samples: list[Sample]) -> list[BoxedPicture]:
    """Read all samples into memory: 2,500 pictures take about 1 GB."""
    return [read_boxed(sample) for sample in tqdm(samples, desc="decoding", unit="picture", mininterval=2.0)]


def _pseudo_persons(sample: Sample) -> NDArray[np.float32]:
    assert sample.label is not None
    path = sample.label.parent.parent / "labels_pseudo_person" / sample.label.name
    if "person" in sample.source.annotated or not path.is_file():
        return np.zeros((0, 5), np.float32)
    return read_boxes(path, PSEUDO_PERSON_MIN_SCORE)


def letterbox_example(item: BoxedPicture, target_wh: tuple[int, int]) -> TrainingExample:
    """Letterbox a picture as perception does, without augmentation."""
    height, width = item.picture.shape[:2]
    return warp_example(item, letterbox_affine((width, height), target_wh), target_wh)


def warp_example(item: BoxedPicture, affine: F32, target_wh: tuple[int, int]) -> TrainingExample:
    """Warp picture, boxes and exhaustive mask; what lies outside the picture is grey and known to be empty.

    A box that is left too small or too hidden is dropped, and its class counts as unknown where it was.
    """
    height, width = item.picture.shape[:2]
    picture = cv2.warpAffine(item.picture, affine, target_wh, flags=cv2.INTER_AREA, borderValue=(PAD_GREY,) * 3).astype(
        np.uint8, copy=False
    )
    exhaustive_mask = np.ones((len(DETECTOR_CLASSES), target_wh[1], target_wh[0]), np.uint8)
    full = item.exhaustive_mask if item.exhaustive_mask.ndim == 3 else None
    for kind in range(len(DETECTOR_CLASSES)):
        if full is not None or item.exhaustive_mask[kind] == 0:
            source = full[kind] if full is not None else np.zeros((height, width), np.uint8)
            exhaustive_mask[kind] = cv2.warpAffine(source, affine, target_wh, flags=cv2.INTER_NEAREST, borderValue=(1,))
    kept_boxes = []
    for kind, *corners in item.boxes:
        ends = np.array(corners).reshape(2, 2) * (width, height) @ affine[:, :2].T + affine[:, 2]
        low, high = ends.min(0), ends.max(0)
        inner_low, inner_high = np.clip(low, 0, target_wh), np.clip(high, 0, target_wh)
        side = inner_high - inner_low
        if (side <= 0).any():
            continue
        if side.min() >= MIN_SIDE_PX and side.prod() >= MIN_VISIBLE_FRAC * (high - low).prod():
            kept_boxes.append((kind, *inner_low, *inner_high))
        else:
            (x1, y1), (x2, y2) = np.floor(inner_low).astype(int), np.ceil(inner_high).astype(int)
            exhaustive_mask[int(kind), y1:y2, x1:x2] = 0
    return TrainingExample(picture, np.array(kept_boxes, np.float32).reshape(-1, 5), _reduce_to_cells(exhaustive_mask))


def _reduce_to_cells(exhaustive_mask: NDArray[np.uint8]) -> NDArray[np.bool_]:
    kinds, height, width = exhaustive_mask.shape
    blocks = exhaustive_mask.reshape(kinds, height // CELL_PX, CELL_PX, width // CELL_PX, CELL_PX)
    return np.asarray(blocks.min((2, 4)), np.bool_)


def random_letterbox_affine(
    rng: Rng, source_wh: tuple[int, int], target_wh: tuple[int, int], zoom: tuple[float, float]
) -> F32:
    """Letterbox, then flip, zoom with a little aspect jitter, and a shift that keeps most of the picture."""
    fit = min(target_wh[0] / source_wh[0], target_wh[1] / source_wh[1])
    scale = fit * np.exp(rng.uniform(np.log(zoom[0]), np.log(zoom[1])))
    stretch = np.exp(rng.uniform(-0.12, 0.12))
    size = np.array([source_wh[0] * scale * stretch, source_wh[1] * scale / stretch])
    slack = np.array(target_wh) - size
    low = rng.uniform(0, 1, 2) * slack
    x_scale, x_low = scale * stretch, low[0]
    if rng.random() < 0.5:
        x_scale, x_low = -x_scale, low[0] + size[0]
    return np.array([[x_scale, 0, x_low], [0, scale / stretch, low[1]]], np.float32)


def close_up_affine(rng: Rng, item: BoxedPicture, target_wh: tuple[int, int]) -> F32 | None:
    """Zoom in on one small object so that its shorter side has CLOSE_UP_PX pixels; None where no object is small."""
    source = np.array(item.picture.shape[1::-1], np.float64)
    fit = float((target_wh / source).min())
    corners = item.boxes[:, 1:].reshape(-1, 2, 2) * source
    sides = (corners[:, 1] - corners[:, 0]).min(1) * fit
    small = np.flatnonzero(sides < SMALL_PX)
    if len(small) == 0:
        return None
    chosen = int(rng.choice(small))
    wanted = np.exp(rng.uniform(*np.log(CLOSE_UP_PX)))
    scale = fit * float(np.clip(wanted / sides[chosen], 1.0, CLOSE_UP_ZOOM))
    size = source * scale
    low = rng.uniform(0.15, 0.85, 2) * target_wh - corners[chosen].mean(0) * scale
    low = np.where(size > target_wh, np.clip(low, target_wh - size, 0.0), (target_wh - size) / 2)
    if rng.random() < 0.5:
        return np.array([[-scale, 0, target_wh[0] - low[0]], [0, scale, low[1]]], np.float32)
    return np.array([[scale, 0, low[0]], [0, scale, low[1]]], np.float32)


def augment_example(rng: Rng, items: list[BoxedPicture], target_wh: tuple[int, int]) -> TrainingExample:
    """Augment one picture, or a two by two mosaic of four, into a training example."""
    if len(items) == 4:
        example = _mosaic(rng, items, target_wh)
    else:
        height, width = items[0].picture.shape[:2]
        affine = close_up_affine(rng, items[0], target_wh) if rng.random() < SMALL_FRAC else None
        if affine is None:
            affine = random_letterbox_affine(rng, (width, height), target_wh, (0.6, 1.8))
        example = warp_example(items[0], affine, target_wh)
    picture = example.picture
    if rng.random() < 0.8:
        picture = jitter_colour(rng, picture)
    if rng.random() < GLARE_FRAC * 0.5:
        picture = add_glare(rng, picture)
    return TrainingExample(degrade_picture(rng, picture), example.boxes, example.exhaustive_mask)


def _mosaic(rng: Rng, items: list[BoxedPicture], target_wh: tuple[int, int]) -> TrainingExample:
    width, height = target_wh
    split_x = int(rng.integers(3, width // CELL_PX - 2)) * CELL_PX
    split_y = int(rng.integers(3, height // CELL_PX - 2)) * CELL_PX
    picture = np.full((height, width, 3), PAD_GREY, np.uint8)
    exhaustive_mask = np.ones((len(DETECTOR_CLASSES), height // CELL_PX, width // CELL_PX), np.bool_)
    boxes = []
    corners = (
        (0, 0, split_x, split_y),
        (split_x, 0, width, split_y),
        (0, split_y, split_x, height),
        (split_x, split_y, width, height),
    )
    for item, (x1, y1, x2, y2) in zip(items, corners, strict=True):
        size = (x2 - x1, y2 - y1)
        affine = random_letterbox_affine(rng, (item.picture.shape[1], item.picture.shape[0]), size, (1.0, 2.2))
        part = warp_example(item, affine, size)
        picture[y1:y2, x1:x2] = part.picture
        exhaustive_mask[:, y1 // CELL_PX : y2 // CELL_PX, x1 // CELL_PX : x2 // CELL_PX] = part.exhaustive_mask
        boxes.append(part.boxes + np.array([0, x1, y1, x1, y1], np.float32))
    return TrainingExample(picture, np.vstack(boxes), exhaustive_mask)
