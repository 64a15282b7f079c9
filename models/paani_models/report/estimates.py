"""Figures with bootstrap intervals, per source and per sequence: what `paani models evaluate --json` writes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TypeVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from paani_models.datasets.sources import DETECTOR_CLASSES, SEGMENTER_CLASSES, Sample, Source
from paani_models.detector.metrics import RECALL_STEPS, ClassMatches, ap50, precision_recall_50, summarise_class
from paani_models.detector.scores import ScoredBoxes, confusion_counts, select_annotated
from paani_models.report.bootstrap import interval_of_items, interval_of_sums
from paani_models.report.evidence import Evidence
from paani_models.segmenter.scores import ScoredMask, mask_measures, sum_counts

ScoredPicture = TypeVar("ScoredPicture", ScoredMask, ScoredBoxes)

ALARMS = "false_alarms_per_picture"
AP_REPLICATES = 200  # an average precision sorts every box again


class Record(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A part of the evaluation. Unknown fields are errors."""


class Estimate(Record, frozen=True, kw_only=True):
    """One figure of a source ("all": pooled), or of one of its sequences.

    n: pictures, or true boxes for detection. low, high: 95 % by drawing its sequences again; None with fewer than two
    sequences, and within one.
    """

    metric: str
    source: str
    sequence: str = ""
    value: float
    low: float | None = None
    high: float | None = None
    n: int
    sequences: int = 1


class Curve(Record, frozen=True, kw_only=True):
    """Best precision at each recall 0, 0.01 .. 1, at IoU 0.5; n counts true boxes."""

    label: str
    source: str
    precision: tuple[float, ...]
    n: int


class Confusion(Record, frozen=True, kw_only=True):
    """Counts of pixels or boxes: rows truth, columns prediction, by `classes`."""

    source: str
    classes: tuple[str, ...]
    counts: tuple[tuple[int, ...], ...]


class MeasuredModel(Record, frozen=True, kw_only=True):
    """The file that was measured."""

    name: str
    sha256: str


class Evaluation(Record, frozen=True, kw_only=True):
    """Models on held-out sequences of labelled pictures, and on nothing else (U7)."""

    evidence: Evidence = Evidence.LABELLED
    models: tuple[MeasuredModel, ...] = ()
    estimates: tuple[Estimate, ...] = ()
    curves: tuple[Curve, ...] = ()
    confusions: tuple[Confusion, ...] = ()


def estimate_masks(scored: Sequence[ScoredMask]) -> tuple[Estimate, ...]:
    """IoU, their mean and edge F1 per source with intervals, then per sequence."""
    estimates = []
    for source in _sources(scored):
        chosen = [item for item in scored if item.sample.source == source]
        groups = _by_sequence(chosen)
        sums = np.stack([sum_counts(items) for items in groups.values()])
        for metric, measure in mask_measures(source).items():
            low, high = interval_of_sums(sums, measure)
            value = measure(sums.sum(0))
            estimates.append(_estimate(metric, source.name, value, len(chosen), low, high, len(groups)))
            for (sequence, items), row in zip(groups.items(), sums, strict=True):
                estimates.append(_estimate(metric, source.name, measure(row), len(items), sequence=sequence))
    return tuple(e for e in estimates if math.isfinite(e.value))


def estimate_boxes(scored: Sequence[ScoredBoxes]) -> tuple[Estimate, ...]:
    """AP50 with interval, AP50:95, recall and precision per class and source, and of all sources; then per sequence."""
    estimates: list[Estimate] = []
    for kind, label in enumerate(DETECTOR_CLASSES):
        chosen = select_annotated(scored, kind)
        matches = {id(item): item.class_matches(kind) for item in chosen}
        for name in [*(source.name for source in _sources(chosen)), *(["all"] if chosen else [])]:
            mine = [item for item in chosen if name in (item.sample.source.name, "all")]
            groups = [[matches[id(item)] for item in items] for items in _by_sequence(mine).values()]
            row = summarise_class([each for group in groups for each in group])
            n = int(row.pop("n"))
            low, high = interval_of_items(groups, _ap50, AP_REPLICATES) if n else (math.nan, math.nan)
            for metric, value in row.items():
                ends = (low, high) if metric == "ap50" else (math.nan, math.nan)
                estimates.append(_estimate(f"{label}_{metric}", name, value, n, *ends, len(groups)))
            if name == "all":
                continue
            for sequence, items in _by_sequence(mine).items():
                each = [matches[id(item)] for item in items]
                boxes = sum(j.positives for j in each)
                estimates.append(_estimate(f"{label}_ap50", name, ap50(each), boxes, sequence=sequence))
    return tuple(e for e in estimates if math.isfinite(e.value))


def estimate_false_alarms(samples: Sequence[Sample], alarms: Sequence[int]) -> tuple[Estimate, ...]:
    """Boxes per picture of classes that a source does not show, with interval, then per sequence."""
    estimates = []
    for source in dict.fromkeys(sample.source for sample in samples):
        groups: dict[str, list[int]] = {}
        for sample, count in zip(samples, alarms, strict=True):
            if sample.source == source:
                groups.setdefault(f"{source.name}/{sample.sequence}", []).append(count)
        sums = np.array([(sum(counts), len(counts)) for counts in groups.values()], np.int64)
        low, high = interval_of_sums(sums, _rate)
        n = int(sums[:, 1].sum())
        estimates.append(_estimate(ALARMS, source.name, _rate(sums.sum(0)), n, low, high, len(groups)))
        for sequence, row in zip(groups, sums, strict=True):
            estimates.append(_estimate(ALARMS, source.name, _rate(row), int(row[1]), sequence=sequence))
    return tuple(estimates)


def _rate(sums: NDArray[np.int64]) -> float:
    return float(sums[0] / sums[1])


def draw_box_curves(scored: Sequence[ScoredBoxes]) -> tuple[Curve, ...]:
    """One curve per class over all sources that annotate it."""
    curves = []
    for kind, label in enumerate(DETECTOR_CLASSES):
        matches = [item.class_matches(kind) for item in select_annotated(scored, kind)]
        n = sum(j.positives for j in matches)
        if n == 0:
            continue
        precision, recall = precision_recall_50(matches)
        best = [float(precision[recall >= step].max(initial=0.0)) for step in RECALL_STEPS]
        curves.append(Curve(label=label, source="all", precision=tuple(round(p, 4) for p in best), n=n))
    return tuple(curves)


def tabulate_mask_confusions(scored: Sequence[ScoredMask]) -> tuple[Confusion, ...]:
    """Pixels, one table per source."""
    tables = []
    for source in _sources(scored):
        counts = np.sum([item.counts for item in scored if item.sample.source == source], axis=0)
        tables.append(_confusion(source.name, SEGMENTER_CLASSES, counts))
    return tuple(tables)


def tabulate_box_confusion(scored: Sequence[ScoredBoxes]) -> Confusion:
    """Boxes of all sources; the last class is nothing."""
    return _confusion("all", (*DETECTOR_CLASSES, "nothing"), confusion_counts(scored))


def _confusion(source: str, classes: tuple[str, ...], counts: NDArray[np.int64]) -> Confusion:
    return Confusion(source=source, classes=classes, counts=tuple(tuple(int(n) for n in row) for row in counts))


def _ap50(matches: list[ClassMatches]) -> float:
    return ap50(matches)


def _sources(scored: Sequence[ScoredMask] | Sequence[ScoredBoxes]) -> list[Source]:
    return list(dict.fromkeys(item.sample.source for item in scored))


def _by_sequence(scored: Sequence[ScoredPicture]) -> dict[str, list[ScoredPicture]]:
    groups: dict[str, list[ScoredPicture]] = {}
    for item in scored:
        groups.setdefault(f"{item.sample.source.name}/{item.sample.sequence}", []).append(item)
    return groups


def _estimate(
    metric: str,
    source: str,
    value: float,
    n: int,
    low: float = math.nan,
    high: float = math.nan,
    sequences: int = 1,
    sequence: str = "",
) -> Estimate:
    known = math.isfinite(low) and math.isfinite(high)
    return Estimate(
        metric=metric,
        source=source,
        sequence=sequence.split("/", 1)[-1],
        value=round(value, 4) if math.isfinite(value) else value,
        low=round(low, 4) if known else None,
        high=round(high, 4) if known else None,
        n=n,
        sequences=sequences,
    )
