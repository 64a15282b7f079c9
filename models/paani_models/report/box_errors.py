"""Error analysis of the detector: recall by object height, outcome of each true object, and scores of its boxes."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from paani_models.datasets.sources import DETECTOR_CLASSES, RENDERED
from paani_models.detector.metrics import CONFIDENCE, average_precision, iou_matrix, match_boxes
from paani_models.detector.scores import ScoredBoxes, select_annotated

HEIGHTS_PX = (0.0, 4.0, 8.0, 16.0, 32.0, 64.0, math.inf)
OUTCOMES = ("found", "scored too low", "taken for another class", "boxed badly", "not seen")
SCORE_STEPS = np.linspace(0.0, 1.0, 21)
TOUCH_IOU, HIT_IOU = 0.1, 0.5


@dataclass(frozen=True)
class HeightBand:
    """True objects of one class whose height in input pixels is at least `low` and under `high`.

    found: at CONFIDENCE. ap50: objects and boxes of other heights neither help nor harm.
    """

    low: float
    high: float
    n: int
    found: int
    ap50: float


@dataclass(frozen=True)
class BoxErrors:
    """One class on photographs. outcomes: true objects by OUTCOMES. right, wrong: boxes per step of SCORE_STEPS."""

    kind: str
    n: int
    ap50: float
    rows: tuple[HeightBand, ...]
    outcomes: tuple[int, ...]
    right: NDArray[np.int64]
    wrong: NDArray[np.int64]

    def count_found_between(self, low: float, high: float) -> tuple[int, int]:
        """Count objects found and objects in all, of the rows between two of HEIGHTS_PX."""
        rows = [row for row in self.rows if low <= row.low and row.high <= high]
        return sum(row.found for row in rows), sum(row.n for row in rows)


def analyse_box_errors(scored: Sequence[ScoredBoxes]) -> list[BoxErrors]:
    """Analyse each class that people boxed in photographs; rendered pictures are left out."""
    photographs = [item for item in scored if item.sample.source.name != RENDERED]
    limits = []
    for kind, label in enumerate(DETECTOR_CLASSES):
        mine = select_annotated(photographs, kind)
        rows = tuple(_score_height_band(mine, kind, *ends) for ends in itertools.pairwise(HEIGHTS_PX))
        n = sum(row.n for row in rows)
        if n == 0:
            continue
        matches = [item.class_matches(kind) for item in mine]
        scores = np.concatenate([j.scores for j in matches])
        hits = np.concatenate([j.hits[0] for j in matches])
        right, wrong = (np.histogram(scores[flags], SCORE_STEPS)[0].astype(np.int64) for flags in (hits, ~hits))
        fates = np.sum([count_outcomes(item, kind) for item in mine], axis=0)
        limits.append(
            BoxErrors(label, n, average_precision(scores, hits, n), rows, tuple(map(int, fates)), right, wrong)
        )
    return limits


def count_outcomes(item: ScoredBoxes, kind: int) -> NDArray[np.int64]:
    """Count the true objects of a class by outcome in one picture; the first of OUTCOMES that applies."""
    real = item.truth[item.truth[:, 0] == kind, 1:]
    same = item.detections.classes == kind
    shared = iou_matrix(real, item.detections.boxes)

    def reached(chosen: NDArray[np.bool_], least: float) -> NDArray[np.bool_]:
        return shared[:, chosen].max(1, initial=0.0) >= least

    met = (
        reached(same & (item.detections.scores > CONFIDENCE), HIT_IOU),
        reached(same, HIT_IOU),
        reached(~same, HIT_IOU),
        reached(same, TOUCH_IOU),
        np.ones(len(real), np.bool_),
    )
    first = np.argmax(np.stack(met), axis=0)
    return np.bincount(first, minlength=len(OUTCOMES))


def _score_height_band(scored: Sequence[ScoredBoxes], kind: int, low: float, high: float) -> HeightBand:
    scores, hits, n, found = [np.zeros(0, np.float32)], [np.zeros(0, np.bool_)], 0, 0
    for item in scored:
        mine = item.detections.classes == kind
        boxes, score = item.detections.boxes[mine], item.detections.scores[mine]
        real = item.truth[item.truth[:, 0] == kind, 1:]
        inside = _is_height_between(real, low, high)
        hit = match_boxes(boxes, score, real[inside], HIT_IOU)
        other = np.zeros(len(boxes), np.bool_)
        other[~hit] = match_boxes(boxes[~hit], score[~hit], real[~inside], HIT_IOU)
        kept = hit | (~other & _is_height_between(boxes, low, high))
        scores.append(score[kept])
        hits.append(hit[kept])
        n += int(inside.sum())
        found += int((hit & (score > CONFIDENCE)).sum())
    return HeightBand(low, high, n, found, average_precision(np.concatenate(scores), np.concatenate(hits), n))


def _is_height_between(boxes: NDArray[np.float32], low: float, high: float) -> NDArray[np.bool_]:
    heights = boxes[:, 3] - boxes[:, 1]
    return np.asarray((heights >= low) & (heights < high), np.bool_)
