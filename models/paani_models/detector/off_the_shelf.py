"""Two networks of 80 COCO classes as they come, as functions from a picture to boxes: yardsticks and teachers.

YOLOX-nano (Ge et al. 2021) runs by onnxruntime and NanoDet-Plus-m (Lyu 2021) by ncnn, both on 416 x 416 pixels, with
their makers' own preprocessing. Of the 80 classes person and boat answer for ours.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import cv2
import numpy as np

from paani.arrays import F32, U8
from paani_models.datasets.sources import DETECTOR_CLASSES
from paani_models.detector.metrics import Detections, decode_boxes
from paani_models.engines.ncnn_runner import open_ncnn_network
from paani_models.engines.onnx_runner import open_network
from paani_models.network_input import PAD_GREY

YOLOX_FILE = "_weights/yolox_nano_coco.onnx"
NANODET_FILES = ("_weights/nanodet-plus-m_416.param", "_weights/nanodet-plus-m_416.bin")
SIDE_PX = 416
COCO_CLASSES = {"person": 0, "vessel": 8}  # ours -> theirs; neither knows a pier or a buoy
KNOWN = frozenset(COCO_CLASSES)

_YOLOX_STRIDES, _NANODET_STRIDES = (8, 16, 32), (8, 16, 32, 64)
_NANODET_MEAN = np.array((103.53, 116.28, 123.675), np.float32)  # BGR
_NANODET_GAIN = np.array((0.017429, 0.017507, 0.017125), np.float32)
_NANODET_CLASSES, _NANODET_BINS = 80, 8

FindBoxes = Callable[[U8, float, int], Detections]


@dataclass(frozen=True)
class OffTheShelf:
    """A network under its name. find: RGB picture [H,W,3], lowest score, most boxes -> boxes in picture pixels."""

    name: str
    find: FindBoxes


def open_off_the_shelf(data: Path, threads: int = 1) -> tuple[OffTheShelf, OffTheShelf]:
    """Both networks of a data folder. Raises UserError naming a file that is missing or unreadable."""
    yolox = open_network(data / YOLOX_FILE, threads)
    param, weights = (data / name for name in NANODET_FILES)
    nanodet = open_ncnn_network(param, weights, threads, "data", "output")
    return (
        OffTheShelf("yolox_nano_coco", partial(_find, yolox, yolox_input, decode_yolox)),
        OffTheShelf("nanodet_plus_m_416", partial(_find, nanodet, nanodet_input, decode_nanodet)),
    )


def _find(
    run: Callable[[F32], F32],
    prepare: Callable[[U8], F32],
    decode: Callable[[F32], F32],
    picture: U8,
    confidence: float,
    limit: int,
) -> Detections:
    candidates = decode(run(prepare(picture))[0])
    candidates[:4] /= SIDE_PX / max(picture.shape[:2])
    found = decode_boxes(candidates, confidence, limit)
    height, width = picture.shape[:2]
    return Detections(found.boxes.clip(0, (width, height, width, height)), found.scores, found.classes)


def _fit_top_left(picture: U8, grey: int) -> U8:
    """BGR, resized with its aspect kept into the upper left corner of a square."""
    scale = SIDE_PX / max(picture.shape[:2])
    size = (max(1, round(picture.shape[1] * scale)), max(1, round(picture.shape[0] * scale)))
    square = np.full((SIDE_PX, SIDE_PX, 3), grey, np.uint8)
    square[: size[1], : size[0]] = cv2.resize(picture, size)[..., ::-1]
    return square


def yolox_input(picture: U8) -> F32:
    """RGB picture -> BGR 0..255 [1,3,416,416]."""
    return np.ascontiguousarray(_fit_top_left(picture, PAD_GREY).transpose(2, 0, 1)[None], np.float32)


def nanodet_input(picture: U8) -> F32:
    """RGB picture -> normalised BGR [1,3,416,416]."""
    scaled = (_fit_top_left(picture, 0).astype(np.float32) - _NANODET_MEAN) * _NANODET_GAIN
    return np.ascontiguousarray(scaled.transpose(2, 0, 1)[None])


def _cells(strides: tuple[int, ...]) -> tuple[F32, F32]:
    """Upper left corner of every cell in cells, [A,2], and its stride [A,1], row by row."""
    corners, sides = [], []
    for stride in strides:
        count = -(-SIDE_PX // stride)
        rows, columns = np.divmod(np.arange(count * count), count)
        corners.append(np.stack([columns, rows], 1))
        sides.append(np.full((count * count, 1), stride))
    return np.concatenate(corners).astype(np.float32), np.concatenate(sides).astype(np.float32)


def _join_rows(centre: F32, size: F32, scores: F32) -> F32:
    rows = np.zeros((4 + len(DETECTOR_CLASSES), len(centre)), np.float32)
    rows[:2], rows[2:4] = centre.T, size.T
    for name, column in COCO_CLASSES.items():
        rows[4 + DETECTOR_CLASSES.index(name)] = scores[:, column]
    return rows


def decode_yolox(output: F32) -> F32:
    """[3549,85] raw offsets, log sizes, objectness and 80 scores -> our rows [8,3549], in network pixels."""
    corner, stride = _cells(_YOLOX_STRIDES)
    centre = (output[:, :2] + corner) * stride
    return _join_rows(centre, np.exp(output[:, 2:4].clip(max=8.0)) * stride, output[:, 4:5] * output[:, 5:])


def decode_nanodet(output: F32) -> F32:
    """[3598,112] 80 scores and four distances of 8 bins each -> our rows [8,3598], in network pixels."""
    corner, stride = _cells(_NANODET_STRIDES)
    bins = output[:, _NANODET_CLASSES:].reshape(-1, 4, _NANODET_BINS)
    share = np.exp(bins - bins.max(2, keepdims=True))
    distance = (share / share.sum(2, keepdims=True)) @ np.arange(_NANODET_BINS, dtype=np.float32) * stride
    low, high = corner * stride - distance[:, :2], corner * stride + distance[:, 2:]
    return _join_rows((low + high) / 2, high - low, output[:, :_NANODET_CLASSES])
