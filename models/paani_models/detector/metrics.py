"""Average precision by COCO's 101-point rule (Lin et al.

2014; U1, U2), and recall and precision at the board's threshold.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from paani.arrays import F32, F64, Bools

IOU_STEPS = np.linspace(0.5, 0.95, 10)  # U2
RECALL_STEPS = np.linspace(0.0, 1.0, 101)  # U1
CONFIDENCE = 0.40  # C6
NMS_IOU = 0.45  # C8
NMS_INPUT = 256  # C7
MAX_BOXES = 24  # C9
NEAR_SIDE_PX = 16.0  # an object whose shorter side is at least this counts as near


@dataclass(frozen=True)
class Detections:
    """Detections in one picture: corner boxes [n,4], scores [n], class ids [n]."""

    boxes: F32
    scores: F32
    classes: NDArray[np.int64]


@dataclass(frozen=True)
class ClassMatches:
    """Detections of one class in one picture, best score first, matched with the true boxes.

    hits: [10, n], by IOU_STEPS. near_found and near: true boxes of NEAR_SIDE_PX and more, found at CONFIDENCE and all.
    """

    scores: F32
    hits: Bools
    positives: int
    near_found: int
    near: int


def decode_boxes(output: F32, confidence: float, limit: int = MAX_BOXES) -> Detections:
    """Decode one picture's output [8,A] into boxes in input pixels: finite, best class, class-agnostic NMS."""
    output = output[:, np.isfinite(output).all(0)]
    best = output[4:].argmax(0)
    score = output[4:].max(0, initial=0.0)
    keep = np.flatnonzero(score > confidence)
    keep = keep[np.argsort(-score[keep], kind="stable")][:NMS_INPUT]
    centre, size = output[:2, keep].T, output[2:4, keep].T
    corner = centre - size / 2
    rows = np.hstack([corner, size]).astype(float)
    kept = np.asarray(cv2.dnn.NMSBoxes(rows.tolist(), score[keep].tolist(), confidence, NMS_IOU), np.int64)[:limit]
    boxes = np.hstack([corner, corner + size])[kept].reshape(-1, 4)
    return Detections(
        boxes.astype(np.float32),
        score[keep][kept].astype(np.float32),
        best[keep][kept].astype(np.int64),
    )


def iou_matrix(a: F32, b: F32) -> F64:
    """IoU matrix [len(a), len(b)] of corner boxes; 0 where both are empty."""
    first, second = a.astype(np.float64), b.astype(np.float64)
    low = np.maximum(first[:, None, :2], second[None, :, :2])
    high = np.minimum(first[:, None, 2:], second[None, :, 2:])
    shared = np.clip(high - low, 0, None).prod(2)
    area_a, area_b = ((x[:, 2:] - x[:, :2]).prod(1) for x in (first, second))
    union = area_a[:, None] + area_b[None] - shared
    return np.divide(shared, union, out=np.zeros_like(shared), where=union > 0)


def match_boxes(boxes: F32, scores: F32, truth: F32, threshold: float) -> Bools:
    """Whether each box, best score first, hits a truth box not hit before; in the order of `boxes`."""
    return _match_greedily(iou_matrix(boxes, truth), scores, threshold)


def _match_greedily(table: F64, scores: F32, threshold: float) -> Bools:
    hits = np.zeros(len(table), np.bool_)
    if table.size == 0:
        return hits
    free = table.copy()
    for index in np.argsort(-scores, kind="stable"):
        target = int(free[index].argmax())
        if free[index, target] >= threshold:
            hits[index] = True
            free[:, target] = -1.0
    return hits


def precision_recall(scores: F32, hits: Bools, positives: int) -> tuple[F64, F64]:
    """Precision and recall after each box, best score first."""
    true = np.cumsum(hits[np.argsort(-scores, kind="stable")])
    return true / np.arange(1, len(true) + 1), true / positives


def average_precision(scores: F32, hits: Bools, positives: int) -> float:
    """Mean of the precision envelope at recalls 0, 0.01 .. 1; NaN without a positive."""
    if positives == 0:
        return float("nan")
    precision, recall = precision_recall(scores, hits, positives)
    envelope = np.maximum.accumulate(precision[::-1])[::-1]
    places = np.searchsorted(recall, RECALL_STEPS, side="left")
    return float(np.where(places < len(envelope), np.append(envelope, 0.0)[places], 0.0).mean())


def match_class(found: Detections, truth: F32, kind: int) -> ClassMatches:
    """Match one class of one picture. truth: [n,5], class and corners."""
    mine = found.classes == kind
    boxes, scores = found.boxes[mine], found.scores[mine]
    order = np.argsort(-scores, kind="stable")
    boxes, scores = boxes[order], scores[order]
    real = truth[truth[:, 0] == kind, 1:]
    near = real[(real[:, 2:] - real[:, :2]).min(1, initial=np.inf) >= NEAR_SIDE_PX]
    table, confident = iou_matrix(boxes, real), scores > CONFIDENCE
    return ClassMatches(
        scores,
        np.stack([_match_greedily(table, scores, step) for step in IOU_STEPS]),
        len(real),
        int(match_boxes(boxes[confident], scores[confident], near, 0.5).sum()),
        len(near),
    )


def ap50(matches: Sequence[ClassMatches]) -> float:
    """AP at IoU 0.5 of one class over pictures."""
    scores, hits, positives = _join_matches(matches)
    return average_precision(scores, hits[0], positives)


def summarise_class(matches: Sequence[ClassMatches]) -> dict[str, float]:
    """AP50, AP50:95, recall and precision at CONFIDENCE of one class over pictures that annotate it.

    `n` counts the true boxes. A figure without a case is NaN.
    """
    scores, hits, positives = _join_matches(matches)
    curves = [average_precision(scores, step, positives) for step in hits]
    confident = scores > CONFIDENCE
    right = int((hits[0] & confident).sum())
    near_found, near = sum(j.near_found for j in matches), sum(j.near for j in matches)
    return {
        "n": positives,
        "ap50": curves[0],
        "ap50_95": float(np.mean(curves)),
        "recall_at_0.40": right / positives if positives else float("nan"),
        "recall_16px_at_0.40": near_found / near if near else float("nan"),
        "precision_at_0.40": right / int(confident.sum()) if confident.any() else float("nan"),
    }


def class_figures(found: list[Detections], truths: list[F32], kind: int) -> dict[str, float]:
    """`summarise_class` of one class. truths: per picture float32 [n,5], class and corners."""
    return summarise_class([match_class(f, truth, kind) for f, truth in zip(found, truths, strict=True)])


def precision_recall_50(matches: Sequence[ClassMatches]) -> tuple[F64, F64]:
    """Precision and recall at IoU 0.5 after each box over all pictures, best score first; empty without a positive."""
    scores, hits, positives = _join_matches(matches)
    if positives == 0:
        return np.zeros(0), np.zeros(0)
    return precision_recall(scores, hits[0], positives)


def _join_matches(matches: Sequence[ClassMatches]) -> tuple[F32, Bools, int]:
    if not matches:
        return np.zeros(0, np.float32), np.zeros((len(IOU_STEPS), 0), np.bool_), 0
    scores = np.concatenate([j.scores for j in matches])
    return scores, np.concatenate([j.hits for j in matches], axis=1), sum(j.positives for j in matches)
