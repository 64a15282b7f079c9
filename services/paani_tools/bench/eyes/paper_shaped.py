"""Perception as the paper's text describes it, for comparison: default sessions, one after the other, plain numpy.

Letterbox and stretch by arithmetic on whole arrays, softmax over every pixel, greedy suppression in Python
(B4, C3-C9, D7, E1-E6). No image-quality check.
"""

from collections.abc import Callable
from typing import NamedTuple

import cv2
import numpy as np

from paani.arrays import F32, U8
from paani.config import CorridorConfig, DetectorConfig
from paani_models.network_input import MEAN, STD

Run = Callable[[F32], F32]
PAD_GREY = 114
WATER = 0


class PaperEvidence(NamedTuple):
    """Boxes x1, y1, x2, y2 in net pixels with their scores; N, U and clear width of each corridor."""

    boxes: list[tuple[F32, float]]
    lanes: list[tuple[float, float, float]]


def perceive(
    bgr: U8,
    detect: Run,
    segment: Run,
    detections: DetectorConfig,
    corridors: CorridorConfig,
    detector_hw: tuple[int, int] = (256, 320),
) -> PaperEvidence:
    """One picture, BGR uint8 [H, W, 3]. detector_hw: of the detector's input, which was 256x320 in the paper."""
    boxes = decode_boxes(detect(letterbox(bgr, detector_hw)), detections)
    return PaperEvidence(boxes, lanes(segment(stretch(bgr)), corridors))


def letterbox(bgr: U8, size_hw: tuple[int, int]) -> F32:
    """float32 [1, 3, H, W]."""
    height, width = size_hw
    scale = min(width / bgr.shape[1], height / bgr.shape[0])
    inner = cv2.resize(bgr, (round(bgr.shape[1] * scale), round(bgr.shape[0] * scale)))
    picture = np.full((height, width, 3), PAD_GREY, np.uint8)
    top, left = (height - inner.shape[0]) // 2, (width - inner.shape[1]) // 2
    picture[top : top + inner.shape[0], left : left + inner.shape[1]] = inner
    rgb = cv2.cvtColor(picture, cv2.COLOR_BGR2RGB).astype(np.float32) / 255.0
    return np.ascontiguousarray(rgb.transpose(2, 0, 1)[None])


def stretch(bgr: U8) -> F32:
    """float32 [1, 3, 256, 320], normalised."""
    rgb = cv2.cvtColor(cv2.resize(bgr, (320, 256)), cv2.COLOR_BGR2RGB).astype(np.float32) / 255.0
    return np.ascontiguousarray(((rgb - MEAN) / STD).transpose(2, 0, 1)[None])


def decode_boxes(output: F32, config: DetectorConfig) -> list[tuple[F32, float]]:
    """Best first."""
    rows = output[0].T
    rows = rows[np.isfinite(rows).all(axis=1)]
    scores = rows[:, 4:].max(axis=1)
    order = np.argsort(-scores, kind="stable")
    found = []
    for i in order[: config.nms_input]:
        if scores[i] > config.confidence:
            cx, cy, w, h = rows[i, :4]
            found.append((np.array([cx - w / 2, cy - h / 2, cx + w / 2, cy + h / 2], np.float32), float(scores[i])))
    kept: list[tuple[F32, float]] = []
    for box, score in found:
        if all(box_iou(box, other) <= config.nms_iou for other, _ in kept):
            kept.append((box, score))
    return kept[: config.max_boxes]


def box_iou(a: F32, b: F32) -> float:
    """Intersection over union."""
    width = max(0.0, float(min(a[2], b[2]) - max(a[0], b[0])))
    height = max(0.0, float(min(a[3], b[3]) - max(a[1], b[1])))
    both = width * height
    return both / (float((a[2] - a[0]) * (a[3] - a[1]) + (b[2] - b[0]) * (b[3] - b[1])) - both + 1e-9)


def lanes(logits: F32, config: CorridorConfig) -> list[tuple[float, float, float]]:
    """Left, centre, right."""
    scores = np.exp(logits[0] - logits[0].max(axis=0))
    probability = scores / scores.sum(axis=0)
    label, confidence = probability.argmax(axis=0), probability.max(axis=0)
    height, width = label.shape
    found = []
    for start, end in (config.left, config.center, config.right):
        part = np.s_[round(config.top * height) :, round(start * width) : round(end * width)]
        water = label[part] == WATER
        best = run = 0
        for share in water.mean(axis=0):
            run = run + 1 if share >= config.clear_column else 0
            best = max(best, run)
        found.append((1.0 - float(water.mean()), 1.0 - float(confidence[part].mean()), best / water.shape[1]))
    return found
