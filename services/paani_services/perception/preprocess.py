"""Pictures to net inputs: letterbox for the detector, stretch for the segmenter (C3, D7, D8). Pure.

Normalisation is one table look-up per channel, straight into the input tensor.
"""

from typing import NamedTuple

import cv2
import numpy as np

from paani.arrays import F32, U8
from paani_models.catalogue import Model


class Letterbox(NamedTuple):
    """Where the picture lies in the input: net pixel = source pixel * scale + offset, per axis."""

    scale_x: float
    scale_y: float
    left_px: int
    top_px: int
    source_w_px: int
    source_h_px: int


def tables(mean: tuple[float, float, float], std: tuple[float, float, float]) -> F32:
    """(v / 255 - mean) / std for each of 256 levels, per RGB channel: float32 [3, 256]."""
    levels = np.arange(256, dtype=np.float32)[None] / 255.0
    scaled = (levels - np.array(mean, np.float32)[:, None]) / np.array(std, np.float32)[:, None]
    return np.asarray(scaled, np.float32)


def tables_for(contract: Model) -> F32 | None:
    """`tables` of a net; None for one that takes bytes and scales them itself."""
    if contract.input.dtype == "uint8":
        return None
    return tables(contract.preprocessing.mean, contract.preprocessing.std)


def letterbox(bgr: U8, height_px: int, width_px: int, pad_grey: int, table: F32 | None) -> tuple[F32 | U8, Letterbox]:
    """Aspect kept, bilinear, centred on grey: a net's input as `stretch` gives it, and where the picture lies in it."""
    source_h, source_w = bgr.shape[:2]
    scale = min(width_px / source_w, height_px / source_h)
    inner_w, inner_h = max(1, round(source_w * scale)), max(1, round(source_h * scale))
    left, top = (width_px - inner_w) // 2, (height_px - inner_h) // 2
    boxed = np.full((height_px, width_px, 3), pad_grey, np.uint8)
    inner = bgr if (inner_w, inner_h) == (source_w, source_h) else cv2.resize(bgr, (inner_w, inner_h))
    boxed[top : top + inner_h, left : left + inner_w] = inner
    return _normalised(boxed, table), Letterbox(inner_w / source_w, inner_h / source_h, left, top, source_w, source_h)


def stretch(bgr: U8, height_px: int, width_px: int, table: F32 | None) -> F32 | U8:
    """Fills the input, bilinear: float32 [1, 3, H, W] in RGB, or uint8 [1, H, W, 3] in RGB without a table."""
    return _normalised(np.asarray(cv2.resize(bgr, (width_px, height_px)), np.uint8), table)


def shrunk(middle: U8, height_px: int, width_px: int, table: F32 | None) -> F32 | U8:
    """A picture averaged down to the gate's input, as `stretch` gives it."""
    small = cv2.resize(middle, (width_px, height_px), interpolation=cv2.INTER_AREA)
    return _normalised(np.asarray(small, np.uint8), table)


def _normalised(bgr: U8, table: F32 | None) -> F32 | U8:
    if table is None:
        return np.asarray(cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB), np.uint8)[None]
    tensor = np.empty((1, 3, *bgr.shape[:2]), np.float32)
    for channel, plane in enumerate(reversed(cv2.split(bgr))):
        cv2.LUT(plane, table[channel], dst=tensor[0, channel])
    return tensor
