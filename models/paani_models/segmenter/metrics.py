"""Segmentation metrics: intersection over union with ignored pixels (U3), and boundary F1 (Csurka et al. 2013; U4)."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from paani.arrays import I64, U8
from paani_models.datasets.sources import IGNORE

EDGE_TOLERANCE_PX = 2  # U4


def confusion_matrix(predicted: U8, truth: U8, classes: int) -> I64:
    """Counts int64 [classes, classes], rows truth, columns prediction; pixels of truth 255 are left out."""
    valid = truth != IGNORE
    joint = truth[valid].astype(np.int64) * classes + predicted[valid]
    return np.bincount(joint, minlength=classes * classes).reshape(classes, classes)


def class_iou(counts: I64) -> NDArray[np.float64]:
    """IoU per class of a confusion matrix, float64 [classes]; NaN where a class neither occurs nor is predicted."""
    hits = np.diag(counts).astype(np.float64)
    union = counts.sum(0) + counts.sum(1) - np.diag(counts)
    return np.asarray(np.divide(hits, union, out=np.full(len(hits), np.nan), where=union > 0), np.float64)


def boundary_pixels(mask: U8) -> NDArray[np.bool_]:
    """Pixels with a four-neighbour of another class, neither of them ignored."""
    edge = np.zeros(mask.shape, np.bool_)
    for first, second in (
        ((slice(None, -1), slice(None)), (slice(1, None), slice(None))),
        ((slice(None), slice(None, -1)), (slice(None), slice(1, None))),
    ):
        differs = (mask[first] != mask[second]) & (mask[first] != IGNORE) & (mask[second] != IGNORE)
        edge[first] |= differs
        edge[second] |= differs
    return edge


def count_edge_matches(predicted: U8, truth: U8) -> tuple[int, int, int, int]:
    """(predicted edge pixels matched, predicted edge pixels, true edge pixels matched, true edge pixels).

    Matched means within EDGE_TOLERANCE_PX, Euclidean. Predicted edges on ignored truth are not judged.
    """
    ours = boundary_pixels(predicted) & (truth != IGNORE)
    theirs = boundary_pixels(truth)
    return (
        int((ours & _dilate_by_tolerance(theirs)).sum()),
        int(ours.sum()),
        int((theirs & _dilate_by_tolerance(ours)).sum()),
        int(theirs.sum()),
    )


def _dilate_by_tolerance(edge: NDArray[np.bool_]) -> NDArray[np.bool_]:
    reach = 2 * EDGE_TOLERANCE_PX + 1
    offsets = np.arange(reach) - EDGE_TOLERANCE_PX
    disc = (offsets[:, None] ** 2 + offsets[None] ** 2 <= EDGE_TOLERANCE_PX**2).astype(np.uint8)
    return np.asarray(cv2.dilate(edge.astype(np.uint8), disc), np.bool_)


def f1_score(matched_predicted: int, predicted: int, matched_true: int, true: int) -> float:
    """Harmonic mean of precision and recall; 0 where nothing matches."""
    precision = matched_predicted / predicted if predicted else 0.0
    recall = matched_true / true if true else 0.0
    return 2 * precision * recall / (precision + recall) if precision + recall else 0.0
