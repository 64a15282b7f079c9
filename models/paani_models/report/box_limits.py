"""What keeps a detector from the truth: the height of what it misses, what becomes of each object, and its scores."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from paani_models.datasets.sources import DETECTOR_CLASSES, RENDERED
from paani_models.detector.metrics import CONFIDENCE, average_precision, match, overlaps
from paani_models.detector.scores import ScoredBoxes, annotating

HEIGHTS_PX = (0.0, 4.0, 8.0, 16.0, 32.0, 64.0, math.inf)
FATES = ("found", "scored too low", "taken for another class", "boxed badly", "not seen")
SCORE_STEPS = np.linspace(0.0, 1.0, 21)
TOUCHES_IOU, HITS_IOU = 0.1, 0.5


@dataclass(frozen=True)
class HeightRow:
    """True objects of one class whose height in input pixels is at least `low` and under `high`.

    found: at CONFIDENCE. ap50: objects and boxes of other heights neither help nor harm.
    """

    low: float
    high: float
    n: int
    found: int
    ap50: float


@dataclass(frozen=True)
class BoxLimits:
    """One class on photographs. fates: true objects by FATES. right, wrong: boxes per step of SCORE_STEPS."""

    kind: str
    n: int
    ap50: float
    rows: tuple[HeightRow, ...]
    fates: tuple[int, ...]
    right: NDArray[np.int64]
    wrong: NDArray[np.int64]

    def found_between(self, low: float, high: float) -> tuple[int, int]:
        """Objects found and objects in all, of the rows between two of HEIGHTS_PX."""
        rows = [row for row in self.rows if low <= row.low and row.high <= high]
        return sum(row.found for row in rows), sum(row.n for row in rows)


def box_limits(scored: Sequence[ScoredBoxes]) -> list[BoxLimits]:
    """One per class that people boxed in photographs: what was drawn by a program stays out."""
    photographs = [item for item in scored if item.sample.source.name != RENDERED]
    limits = []
    for kind, label in enumerate(DETECTOR_CLASSES):
        mine = annotating(photographs, kind)
        rows = tuple(_height_row(mine, kind, *ends) for ends in itertools.pairwise(HEIGHTS_PX))
        n = sum(row.n for row in rows)
        if n == 0:
            continue
        judged = [item.judged(kind) for item in mine]
        scores = np.concatenate([j.scores for j in judged])
        hits = np.concatenate([j.hits[0] for j in judged])
        right, wrong = (np.histogram(scores[flags], SCORE_STEPS)[0].astype(np.int64) for flags in (hits, ~hits))
        fates = np.sum([fates_of(item, kind) for item in mine], axis=0)
        limits.append(
            BoxLimits(label, n, average_precision(scores, hits, n), rows, tuple(map(int, fates)), right, wrong)
        )
    return limits


def fates_of(item: ScoredBoxes, kind: int) -> NDArray[np.int64]:
    """How many true objects of a class met each of FATES in one picture; the first that fits."""
    real = item.truth[item.truth[:, 0] == kind, 1:]
    same = item.found.classes == kind
    shared = overlaps(real, item.found.boxes)

    def reached(chosen: NDArray[np.bool_], least: float) -> NDArray[np.bool_]:
        return shared[:, chosen].max(1, initial=0.0) >= least

    met = (
        reached(same & (item.found.scores > CONFIDENCE), HITS_IOU),
        reached(same, HITS_IOU),
        reached(~same, HITS_IOU),
        reached(same, TOUCHES_IOU),
        np.ones(len(real), np.bool_),
    )
    first = np.argmax(np.stack(met), axis=0)
    return np.bincount(first, minlength=len(FATES))


def _height_row(scored: Sequence[ScoredBoxes], kind: int, low: float, high: float) -> HeightRow:
    scores, hits, n, found = [np.zeros(0, np.float32)], [np.zeros(0, np.bool_)], 0, 0
    for item in scored:
        mine = item.found.classes == kind
        boxes, score = item.found.boxes[mine], item.found.scores[mine]
        real = item.truth[item.truth[:, 0] == kind, 1:]
        inside = _between(real, low, high)
        hit = match(boxes, score, real[inside], HITS_IOU)
        other = np.zeros(len(boxes), np.bool_)
        other[~hit] = match(boxes[~hit], score[~hit], real[~inside], HITS_IOU)
        kept = hit | (~other & _between(boxes, low, high))
        scores.append(score[kept])
        hits.append(hit[kept])
        n += int(inside.sum())
        found += int((hit & (score > CONFIDENCE)).sum())
    return HeightRow(low, high, n, found, average_precision(np.concatenate(scores), np.concatenate(hits), n))


def _between(boxes: NDArray[np.float32], low: float, high: float) -> NDArray[np.bool_]:
    heights = boxes[:, 3] - boxes[:, 1]
    return np.asarray((heights >= low) & (heights < high), np.bool_)
