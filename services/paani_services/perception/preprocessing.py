"""Pictures to network inputs: letterbox for the detector, stretch for the segmenter (C3, D7, D8). Pure.

Pixel values are normalised by one table look-up per channel, written straight into the input tensor.
"""

from typing import NamedTuple

import cv2
import numpy as np

from paani.arrays import F32, U8
from paani_models.catalogue import Model


class LetterboxTransform(NamedTuple):
    """From the picture to the network's input: input pixel = picture pixel * scale + offset, per axis."""

    scale_x: float
    scale_y: float
    left_px: int
    top_px: int
    source_w_px: int
    source_h_px: int


def build_lookup_tables(mean: tuple[float, float, float], std: tuple[float, float, float]) -> F32:
    """(level / 255 - mean) / std for each of 256 levels, per RGB channel: float32 [3, 256]."""
    levels = np.arange(256, dtype=np.float32)[None] / 255.0
    scaled = (levels - np.array(mean, np.float32)[:, None]) / np.array(std, np.float32)[:, None]
    return np.asarray(scaled, np.float32)


def lookup_tables_for(contract: Model) -> F32 | None:
    """Look-up tables of a network; None for one that takes bytes and normalises them itself."""
    if contract.input.dtype == "uint8":
        return None
    return build_lookup_tables(contract.preprocessing.mean, contract.preprocessing.std)


def letterbox_picture(
    bgr: U8, height_px: int, width_px: int, pad_grey: int, table: F32 | None
) -> tuple[F32 | U8, LetterboxTransform]:
    """The picture with its aspect kept, bilinear, centred on grey; the tensor is as `stretch_picture` returns it."""
    source_h, source_w = bgr.shape[:2]
    scale = min(width_px / source_w, height_px / source_h)
    inner_w, inner_h = max(1, round(source_w * scale)), max(1, round(source_h * scale))
    left, top = (width_px - inner_w) // 2, (height_px - inner_h) // 2
    boxed = np.full((height_px, width_px, 3), pad_grey, np.uint8)
    inner = bgr if (inner_w, inner_h) == (source_w, source_h) else cv2.resize(bgr, (inner_w, inner_h))
    boxed[top : top + inner_h, left : left + inner_w] = inner
    return _normalise(boxed, table), LetterboxTransform(
        inner_w / source_w, inner_h / source_h, left, top, source_w, source_h
    )


def stretch_picture(bgr: U8, height_px: int, width_px: int, table: F32 | None) -> F32 | U8:
    """The picture stretched over the input, bilinear: RGB float32 [1, 3, H, W]; without a table uint8 [1, H, W, 3]."""
    return _normalise(np.asarray(cv2.resize(bgr, (width_px, height_px)), np.uint8), table)


def shrink_picture(bgr: U8, height_px: int, width_px: int, table: F32 | None) -> F32 | U8:
    """The picture averaged down to the input of the fitness network; the tensor is as `stretch_picture` returns it."""
    small = cv2.resize(bgr, (width_px, height_px), interpolation=cv2.INTER_AREA)
    return _normalise(np.asarray(small, np.uint8), table)


def _normalise(bgr: U8, table: F32 | None) -> F32 | U8:
    if table is None:
        return np.asarray(cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB), np.uint8)[None]
    tensor = np.empty((1, 3, *bgr.shape[:2]), np.float32)
    for channel, plane in enumerate(reversed(cv2.split(bgr))):
        cv2.LUT(plane, table[channel], dst=tensor[0, channel])
    return tensor
