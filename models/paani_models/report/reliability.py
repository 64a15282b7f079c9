"""How far a detector's scores are to be trusted: reliability diagram, expected calibration error, thresholds.

A score is compared with the share of boxes of such scores that hit a true box at IoU 0.5 (Guo et al. 2017, over boxes
as in Kuppers et al. 2020). Intervals are block bootstraps over whole sequences.
"""

from __future__ import annotations

from collections.abc import Sequence

import msgspec
import numpy as np
from numpy.typing import NDArray

from paani.arrays import F64
from paani_models.datasets.sources import DETECTOR_CLASSES
from paani_models.report.bootstrap import draw_sequence_counts, percentile_interval
from paani_models.report.height_scores import (
    ANY_HEIGHT_PX,
    DetectorRun,
    Interval,
    MatchedBoxes,
    PictureResult,
    match_pictures,
    truth_pictures,
)

BINS = 10  # of equal width over scores 0..1
MIN_SCORE = 0.1  # boxes below are no candidates of any threshold and would drown the others
RECALL_WEIGHT = {"person": 2.0}  # of F: how much more a miss weighs than a false alarm; 1 for the other classes
STEPS = np.round(np.arange(0.10, 0.901, 0.01), 2)  # thresholds that are tried


class ReliabilityBin(msgspec.Struct, frozen=True):
    """Boxes with scores in low..high: how many, their mean score, and the share that is right."""

    low: float
    high: float
    n: int
    mean_score: float
    right_frac: float


class Reliability(msgspec.Struct, frozen=True, kw_only=True):
    """One detector and class over every picture whose boxes are truth.

    error: expected calibration error, the mean distance of score and share right, weighted by boxes. threshold: where
    F is highest, with RECALL_WEIGHT; recall and precision there.
    """

    detector: str
    kind: str
    boxes: int
    positives: int
    error: Interval
    bins: tuple[ReliabilityBin, ...]
    threshold: float
    recall: float
    precision: float


def measure_reliability(results: Sequence[PictureResult], detectors: Sequence[DetectorRun]) -> list[Reliability]:
    """Every class and detector that knows it; nothing for a class without a true box or without a scored one."""
    rows = []
    for kind, label in enumerate(DETECTOR_CLASSES):
        chosen = truth_pictures(results, label)
        for each in detectors:
            if label not in each.known:
                continue
            matched = match_pictures(chosen, each.name, kind, ANY_HEIGHT_PX)
            if matched.positives.sum() and (matched.scores >= MIN_SCORE).any():
                rows.append(_measure(each.name, label, matched))
    return rows


def _measure(detector: str, kind: str, matched: MatchedBoxes) -> Reliability:
    kept = matched.scores >= MIN_SCORE
    scores, hits = matched.scores[kept].astype(np.float64), matched.hits[kept]
    place = np.minimum((scores * BINS).astype(np.int64), BINS - 1)
    size = len(matched.positives)
    cells = np.zeros((size, BINS, 3))  # of each sequence and bin: boxes, sum of scores, right ones
    np.add.at(cells, (matched.places[kept], place), np.stack([np.ones(len(scores)), scores, hits], 1))
    weights = draw_sequence_counts(size) if size > 1 else np.zeros((0, size), np.int64)
    drawn = np.tensordot(weights.astype(np.float64), cells, 1)
    total = cells.sum(0)
    threshold, recall, precision = _best_threshold(scores, hits, int(matched.positives.sum()), kind)
    return Reliability(
        detector=detector,
        kind=kind,
        boxes=len(scores),
        positives=int(matched.positives.sum()),
        error=Interval(
            float(calibration_error(total[None])[0]),
            *percentile_interval(calibration_error(drawn)),
        ),
        bins=tuple(
            ReliabilityBin(i / BINS, (i + 1) / BINS, int(n), float(score / n), float(right / n))
            for i, (n, score, right) in enumerate(total)
            if n > 0
        ),
        threshold=threshold,
        recall=recall,
        precision=precision,
    )


def calibration_error(cells: F64) -> F64:
    """Counts [..., BINS, 3] of boxes, their scores and right ones -> expected calibration error [...]; NaN for none."""
    boxes = cells[..., 0].sum(-1)
    apart = np.abs(cells[..., 1] - cells[..., 2]).sum(-1)
    return np.asarray(np.divide(apart, boxes, out=np.full(boxes.shape, np.nan), where=boxes > 0), np.float64)


def _best_threshold(scores: F64, hits: NDArray[np.bool_], positives: int, kind: str) -> tuple[float, float, float]:
    """The threshold of STEPS with the highest F, the lower of equals, with recall and precision there."""
    beta2 = RECALL_WEIGHT.get(kind, 1.0) ** 2
    above = scores[None] > STEPS[:, None]
    right, count = (above & hits).sum(1), above.sum(1)
    f = (1 + beta2) * right / (beta2 * positives + count)
    best = int(f.argmax())
    precision = right[best] / count[best] if count[best] else float("nan")
    return float(STEPS[best]), float(right[best] / positives), float(precision)


def format_reliability(rows: Sequence[Reliability]) -> str:
    """One line per class and detector, and under it the bins as score -> share right (boxes)."""
    lines = [
        f"Scores of {MIN_SCORE} and more against the share of boxes that are right; 95 % intervals over sequences."
    ]
    for row in rows:
        span = "" if np.isnan(row.error.low) else f" [{row.error.low:.3f}, {row.error.high:.3f}]"
        weight = RECALL_WEIGHT.get(row.kind, 1.0)
        lines.append(
            f"{row.kind:<7} {row.detector:<20} error {row.error.value:.3f}{span}, {row.boxes} boxes of {row.positives}"
            f" true; F{weight:.0f} best above {row.threshold:.2f}:"
            f" recall {row.recall:.3f}, precision {row.precision:.3f}"
        )
        lines.append("        " + " ".join(f"{b.mean_score:.2f}->{b.right_frac:.2f} ({b.n})" for b in row.bins))
    return "\n".join(lines) + "\n"
