"""Average precision by the 101-point rule (checklist U1, U2), and recall and false alarms at the board's threshold."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]

IOU_STEPS = np.arange(0.5, 0.96, 0.05)
CONFIDENCE = 0.40  # checklist C6
NMS_IOU = 0.45  # checklist C8
NMS_INPUT = 256  # checklist C7
MAX_BOXES = 24  # checklist C9
NEAR_SIDE_PX = 16.0  # an object whose shorter side is at least this counts as near


@dataclass(frozen=True)
class Found:
    """What was found in one picture: corner boxes [n,4], scores [n], class ids [n]."""

    boxes: Floats
    scores: Floats
    classes: NDArray[np.int64]


def decode(output: Floats, confidence: float, limit: int = MAX_BOXES) -> Found:
    """One picture's net output [8,A] -> boxes in input pixels: finite, best class, class-agnostic NMS."""
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
    return Found(
        boxes.astype(np.float32),
        score[keep][kept].astype(np.float32),
        best[keep][kept].astype(np.int64),
    )


def overlaps(a: Floats, b: Floats) -> NDArray[np.float64]:
    """IoU matrix [len(a), len(b)] of corner boxes."""
    low = np.maximum(a[:, None, :2], b[None, :, :2])
    high = np.minimum(a[:, None, 2:], b[None, :, 2:])
    shared = np.clip(high - low, 0, None).prod(2)
    area_a, area_b = ((x[:, 2:] - x[:, :2]).prod(1) for x in (a, b))
    return np.asarray(shared / (area_a[:, None] + area_b[None] - shared + 1e-9), np.float64)


def match(boxes: Floats, scores: Floats, truth: Floats, threshold: float) -> NDArray[np.bool_]:
    """Whether each box, best score first, hits a truth box not hit before; in the order of `boxes`."""
    hits = np.zeros(len(boxes), np.bool_)
    if len(boxes) == 0 or len(truth) == 0:
        return hits
    table = overlaps(boxes, truth)
    for index in np.argsort(-scores, kind="stable"):
        target = int(table[index].argmax())
        if table[index, target] >= threshold:
            hits[index] = True
            table[:, target] = -1.0
    return hits


def average_precision(scores: Floats, hits: NDArray[np.bool_], positives: int) -> float:
    """Mean of the precision envelope at recalls 0, 0.01 .. 1; NaN without a positive."""
    if positives == 0:
        return float("nan")
    order = np.argsort(-scores, kind="stable")
    true = np.cumsum(hits[order])
    recall = true / positives
    precision = true / np.arange(1, len(order) + 1)
    envelope = np.maximum.accumulate(precision[::-1])[::-1]
    places = np.searchsorted(recall, np.linspace(0, 1, 101), side="left")
    return float(np.where(places < len(envelope), np.append(envelope, 0.0)[places], 0.0).mean())


def class_figures(found: list[Found], truths: list[Floats], kind: int) -> dict[str, float]:
    """AP50, AP50:95, recall and precision at CONFIDENCE of one class over pictures that annotate it.

    truths: per picture float32 [n,5], class and corners. `n` counts the true boxes. A figure without a case is NaN.
    """
    of_kind = [(f.boxes[f.classes == kind], f.scores[f.classes == kind]) for f in found]
    real = [truth[truth[:, 0] == kind, 1:] for truth in truths]
    positives = sum(len(r) for r in real)
    scores = np.concatenate([s for _, s in of_kind]) if of_kind else np.zeros(0, np.float32)
    none = np.zeros(0, np.bool_)
    steps = [
        np.concatenate([none, *(match(b, s, r, step) for (b, s), r in zip(of_kind, real, strict=True))])
        for step in IOU_STEPS
    ]
    curves = [average_precision(scores, hits, positives) for hits in steps]
    confident = scores > CONFIDENCE
    right = int((steps[0] & confident).sum())
    near = [r[(r[:, 2:] - r[:, :2]).min(1, initial=np.inf) >= NEAR_SIDE_PX] for r in real]
    near_found = sum(
        int(match(b[s > CONFIDENCE], s[s > CONFIDENCE], r, 0.5).sum()) for (b, s), r in zip(of_kind, near, strict=True)
    )
    near_count = sum(len(r) for r in near)
    return {
        "n": positives,
        "ap50": curves[0],
        "ap50_95": float(np.mean(curves)),
        "recall_at_0.40": right / positives if positives else float("nan"),
        "recall_16px_at_0.40": near_found / near_count if near_count else float("nan"),
        "precision_at_0.40": right / int(confident.sum()) if confident.any() else float("nan"),
    }
