"""Score detectors by the height of the true box in pixels of the source picture, with intervals over sequences.

A box of another height is neither required nor counted against a detector, as in COCO's size ranges (Lin et al. 2014).
Intervals are block bootstraps over whole sequences.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import msgspec
import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from paani.arrays import F32, F64, U8, Bools
from paani_models.datasets.sources import DETECTOR_CLASSES, Sample, read_boxes, read_picture
from paani_models.detector.metrics import CONFIDENCE, RECALL_STEPS, Detections, average_precision, iou_matrix
from paani_models.detector.scores import SCORED_BOXES, SCORED_CONFIDENCE
from paani_models.report.bootstrap import draw_sequence_counts, percentile_interval

HEIGHTS_PX = ((8.0, 16.0), (16.0, 32.0), (32.0, 64.0), (64.0, np.inf))
ANY_HEIGHT_PX = (0.0, np.inf)
MATCH_IOU = 0.5
SEEN_IOU = 0.2
ALL_SOURCES = "all"

FindBoxes = Callable[[U8, float, int], Detections]
Threshold = Callable[[str], float]  # class -> above which a box counts


@dataclass(frozen=True)
class DetectorRun:
    """A detector under its name, the classes that it knows, and its function from a picture to boxes in its pixels."""

    name: str
    known: frozenset[str]
    find: FindBoxes


@dataclass(frozen=True)
class PictureResult:
    """One picture: true boxes float32 [n,5] (class, corners) and each detector's boxes, all in source pixels."""

    sample: Sample
    truth: F32
    found: dict[str, Detections]


class Interval(msgspec.Struct, frozen=True):
    """A value and its 95 % interval; NaN where there is no case or only one sequence."""

    value: float
    low: float
    high: float


class HeightRow(msgspec.Struct, frozen=True, kw_only=True):
    """One detector on one class, source and range of heights. n: true boxes; all but AP50 at the threshold.

    seen: share of the true boxes that a box of the class overlaps by `SEEN_IOU`, however it is drawn: an advice keeps
    off what is seen, and recall asks for `MATCH_IOU`.
    """

    detector: str
    kind: str
    source: str
    low_px: float
    high_px: float
    n: int
    sequences: int
    ap50: Interval
    recall: Interval
    precision: Interval
    seen: Interval


def run_detectors(detectors: Sequence[DetectorRun], samples: Sequence[Sample]) -> list[PictureResult]:
    """Every detector on every picture with boxes, in the same way. Raises UserError naming an unreadable file."""
    results = []
    for sample in tqdm([s for s in samples if s.label], "detectors", unit="picture", mininterval=2.0):
        assert sample.label is not None
        picture = read_picture(sample.picture)
        height, width = picture.shape[:2]
        truth = read_boxes(sample.label) * np.array([1, width, height, width, height], np.float32)
        found = {each.name: each.find(picture, SCORED_CONFIDENCE, SCORED_BOXES) for each in detectors}
        results.append(PictureResult(sample, truth, found))
    return results


@dataclass(frozen=True)
class MatchedBoxes:
    """Boxes of one class and range over pictures, best score first; positives: true boxes of each sequence."""

    scores: F32
    hits: Bools
    places: NDArray[np.int64]
    positives: NDArray[np.int64]


def match_in_range(found: Detections, truth: F32, kind: int, range_px: tuple[float, float]) -> tuple[F32, Bools, int]:
    """Scores and hits of the boxes that count, best score first, and the number of true boxes in the range.

    A box takes the free true box of the range that it overlaps most, else one of another height, which then does not
    count; a box that hits nothing counts where its own height lies in the range.
    """
    mine = np.flatnonzero(found.classes == kind)
    mine = mine[np.argsort(-found.scores[mine], kind="stable")]
    boxes, scores = found.boxes[mine], found.scores[mine]
    real = truth[truth[:, 0] == kind, 1:]
    wanted = _in_range(real, range_px)
    shared, own = iou_matrix(boxes, real), _in_range(boxes, range_px)
    free = np.ones(len(real), np.bool_)
    hits, counted = np.zeros(len(mine), np.bool_), np.zeros(len(mine), np.bool_)
    for index, row in enumerate(shared):
        near = free & (row >= MATCH_IOU)
        target = near & wanted if (near & wanted).any() else near
        if target.any():
            chosen = int(np.where(target, row, -1.0).argmax())
            free[chosen] = False
            hits[index] = counted[index] = wanted[chosen]
        else:
            counted[index] = own[index]
    return scores[counted], hits[counted], int(wanted.sum())


def count_seen(found: Detections, truth: F32, kind: int, range_px: tuple[float, float], threshold: float) -> int:
    """How many true boxes of the range a box of the class above the threshold overlaps by `SEEN_IOU`."""
    boxes = found.boxes[(found.classes == kind) & (found.scores > threshold)]
    real = truth[truth[:, 0] == kind, 1:]
    return int((iou_matrix(real[_in_range(real, range_px)], boxes) >= SEEN_IOU).any(1).sum())


def _in_range(boxes: F32, range_px: tuple[float, float]) -> Bools:
    heights = boxes[:, 3] - boxes[:, 1]
    return np.asarray((heights >= range_px[0]) & (heights < range_px[1]), np.bool_)


def truth_pictures(results: Sequence[PictureResult], label: str) -> list[PictureResult]:
    """Those whose source boxes every object of a class, and tightly."""
    sources = ((each, each.sample.source) for each in results)
    return [each for each, source in sources if label in source.annotated and not source.loose_boxes]


def common_threshold(kind: str) -> float:
    """C6, whatever the class."""
    del kind
    return CONFIDENCE


def score_heights(
    results: Sequence[PictureResult], detectors: Sequence[DetectorRun], threshold: Threshold = common_threshold
) -> list[HeightRow]:
    """Every class, source that annotates it and range that has true boxes, and every detector that knows the class.

    Sources with loose boxes have rows of their own and are no part of `all`.
    """
    rows = []
    for kind, label in enumerate(DETECTOR_CLASSES):
        annotated = [r for r in results if label in r.sample.source.annotated]
        names = list(dict.fromkeys(r.sample.source.name for r in annotated))
        for source in [*names, *([ALL_SOURCES] if len(names) > 1 else [])]:
            chosen = [r for r in annotated if r.sample.source.name == source]
            if source == ALL_SOURCES:
                chosen = truth_pictures(results, label)
            for range_px in (*HEIGHTS_PX, ANY_HEIGHT_PX):
                limit = threshold(label)
                for each in detectors:
                    if label not in each.known:
                        continue
                    matched = match_pictures(chosen, each.name, kind, range_px)
                    if matched.positives.sum():
                        seen = _seen_per_sequence(chosen, each.name, kind, range_px, limit)
                        rows.append(_row(each.name, label, source, range_px, matched, seen, limit))
    return rows


def match_pictures(
    results: Sequence[PictureResult], detector: str, kind: int, range_px: tuple[float, float]
) -> MatchedBoxes:
    """One detector's boxes of one class over pictures that annotate it."""
    places = _number_sequences(results)
    positives = np.zeros(len(places), np.int64)
    scores, hits, owners = [np.zeros(0, np.float32)], [np.zeros(0, np.bool_)], [np.zeros(0, np.int64)]
    for result in results:
        place = places[result.sample.source.name, result.sample.sequence]
        score, hit, count = match_in_range(result.found[detector], result.truth, kind, range_px)
        positives[place] += count
        scores.append(score)
        hits.append(hit)
        owners.append(np.full(len(score), place))
    joined = np.concatenate(scores)
    order = np.argsort(-joined, kind="stable")
    return MatchedBoxes(joined[order], np.concatenate(hits)[order], np.concatenate(owners)[order], positives)


def _number_sequences(results: Sequence[PictureResult]) -> dict[tuple[str, str], int]:
    return {key: i for i, key in enumerate(dict.fromkeys((r.sample.source.name, r.sample.sequence) for r in results))}


def _seen_per_sequence(
    results: Sequence[PictureResult], detector: str, kind: int, range_px: tuple[float, float], threshold: float
) -> F64:
    places = _number_sequences(results)
    seen = np.zeros(len(places))
    for result in results:
        place = places[result.sample.source.name, result.sample.sequence]
        seen[place] += count_seen(result.found[detector], result.truth, kind, range_px, threshold)
    return seen


def _row(
    detector: str,
    kind: str,
    source: str,
    range_px: tuple[float, float],
    matched: MatchedBoxes,
    seen: F64,
    threshold: float,
) -> HeightRow:
    confident = matched.scores > threshold
    right = matched.hits & confident
    size = len(matched.positives)
    per_sequence = np.stack(
        [
            np.bincount(matched.places, right, size),
            np.bincount(matched.places, confident, size),
            matched.positives.astype(np.float64),
            seen,
        ]
    )
    weights = draw_sequence_counts(size) if size > 1 else np.zeros((0, size), np.int64)
    total, drawn = per_sequence.sum(1), weights.astype(np.float64) @ per_sequence.T
    curves = np.array([weighted_average_precision(matched, row) for row in weights], np.float64)
    ap50 = average_precision(matched.scores, matched.hits, int(matched.positives.sum()))
    return HeightRow(
        detector=detector,
        kind=kind,
        source=source,
        low_px=range_px[0],
        high_px=range_px[1],
        n=int(total[2]),
        sequences=size,
        ap50=_interval(ap50, curves),
        recall=_interval(_ratio(total[:1], total[2:3])[0], _ratio(drawn[:, 0], drawn[:, 2])),
        precision=_interval(_ratio(total[:1], total[1:2])[0], _ratio(drawn[:, 0], drawn[:, 1])),
        seen=_interval(_ratio(total[3:], total[2:3])[0], _ratio(drawn[:, 3], drawn[:, 2])),
    )


def weighted_average_precision(matched: MatchedBoxes, weights: NDArray[np.int64]) -> float:
    """Average precision where sequence i stands weights[i] times; NaN where no true box is drawn."""
    positives = int(matched.positives @ weights)
    if positives == 0:
        return float("nan")
    times = weights[matched.places]
    kept = times > 0
    if not kept.any():
        return 0.0
    true, count = np.cumsum((times * matched.hits)[kept]), np.cumsum(times[kept])
    envelope = np.maximum.accumulate((true / count)[::-1])[::-1]
    places = np.searchsorted(true / positives, RECALL_STEPS, side="left")
    return float(np.where(places < len(envelope), np.append(envelope, 0.0)[places], 0.0).mean())


def _ratio(part: F64, whole: F64) -> F64:
    return np.divide(part, whole, out=np.full(len(whole), np.nan), where=whole > 0)


def _interval(value: float, drawn: F64) -> Interval:
    low, high = percentile_interval(drawn)
    return Interval(float(value), low, high)
