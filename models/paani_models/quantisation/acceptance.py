"""Acceptance test of an INT8 network: whether it may take the FP32 network's place, by rule, with the reason (T5)."""

from __future__ import annotations

import platform
from collections.abc import Callable, Sequence
from pathlib import Path

import msgspec
import numpy as np

from paani.arrays import F32
from paani.clock import stopwatch_ms
from paani.statistics.order_statistics import median
from paani_models.catalogue import Figure
from paani_models.datasets.sources import DETECTOR_CLASSES, Sample
from paani_models.detector.metrics import ap50
from paani_models.detector.scores import score_boxes, select_annotated
from paani_models.engines.onnx_runner import open_network
from paani_models.segmenter.scores import mask_measures, score_masks, scored_classes, sum_counts

MAX_LOSS_POINTS = 1.0  # percentage points of mIoU or AP50
MAX_TIME_RATIO = 1.0  # INT8 over FP32
MIN_SCORE_RATIO = 0.5  # of the largest score that FP32 gives; below it the network counts as blind
MAX_SCORE = 1.001  # a larger score is no probability
SCORE_ROWS = 4  # of a detector's output, where the scores begin
TIMED_RUNS, WARM_UP_RUNS = 60, 5
THREADS = 2
RULE = (
    f"accept if the INT8 net loses at most {MAX_LOSS_POINTS:g} point, is not blind, "
    "and takes no more time than FP32 on this machine unless only its size matters"
)


class Timing(msgspec.Struct, frozen=True):
    """Medians of interleaved runs, [ms]."""

    float_ms: float
    int8_ms: float

    @property
    def ratio(self) -> float:
        """INT8 over FP32."""
        return self.int8_ms / self.float_ms


class Verdict(msgspec.Struct, frozen=True):
    """Result of the acceptance test, and why."""

    accepted: bool
    reason: str
    rule: str = RULE


class QuantisationRecord(msgspec.Struct, frozen=True):
    """Everything that one acceptance was decided on. Figures are of held-out pictures; scores are shares of 1."""

    net: str
    recipe: str
    file: str
    sha256: str
    float_sha256: str
    size_bytes: int
    float_size_bytes: int
    calibration_pictures: int
    calibration_sha256: str
    metric: str
    score: float
    float_score: float
    figures: tuple[Figure, ...]
    float_figures: tuple[Figure, ...]
    best_score: float | None
    float_best_score: float | None
    timing: Timing
    threads: int
    machine: str
    for_size: bool
    verdict: Verdict


def decide_acceptance(
    loss_points: float,
    time_ratio: float,
    *,
    for_size: bool,
    metric: str = "score",
    largest_score: float | None = None,
    float_largest_score: float | None = None,
) -> Verdict:
    """Apply RULE. largest_score: the largest score that a detector gives on the calibration pictures; None for others.

    A loss or ratio that is not a number is a rejection.
    """
    if largest_score is not None and float_largest_score and not largest_score >= MIN_SCORE_RATIO * float_largest_score:
        return Verdict(False, f"blind: best score {largest_score:.3f} where FP32 gives {float_largest_score:.3f}")
    if largest_score is not None and largest_score > MAX_SCORE:
        return Verdict(False, f"blind: best score {largest_score:.3f} is no probability")
    if not loss_points <= MAX_LOSS_POINTS:
        return Verdict(False, f"loses {loss_points:.2f} points of {metric}, more than {MAX_LOSS_POINTS:g}")
    change = f"gains {-loss_points:.2f}" if loss_points < 0 else f"loses {loss_points:.2f}"
    if not time_ratio <= MAX_TIME_RATIO:
        if not for_size:
            return Verdict(False, f"takes {time_ratio:.2f} times as long as FP32 here ({change} points of {metric})")
        return Verdict(True, f"{change} points of {metric}; slower ({time_ratio:.2f} times), accepted for its size")
    return Verdict(True, f"{change} points of {metric}, takes {time_ratio:.2f} times as long as FP32")


def score_segmenter(net: Path, samples: Sequence[Sample]) -> tuple[float, tuple[Figure, ...]]:
    """Mean IoU of the classes that people drew, averaged over sources; and that mean for each source."""
    scored = score_masks(net, samples)
    figures = []
    for source in dict.fromkeys(item.sample.source for item in scored):
        chosen = [item for item in scored if item.sample.source == source]
        sums = sum_counts(chosen)
        values = [mask_measures(source)[f"iou_{kind}"](sums) for kind in scored_classes(source)]
        figures.append(Figure("miou", source.name, round(float(np.nanmean(values)), 4), len(chosen)))
    return float(np.mean([figure.value for figure in figures])), tuple(figures)


def score_detector(net: Path, samples: Sequence[Sample]) -> tuple[float, tuple[Figure, ...]]:
    """AP50 averaged over the classes that occur; and that of each class. n counts true boxes."""
    scored = score_boxes(net, samples)
    figures = []
    for kind, label in enumerate(DETECTOR_CLASSES):
        matches = [item.class_matches(kind) for item in select_annotated(scored, kind)]
        positives = sum(item.positives for item in matches)
        if positives:
            figures.append(Figure(f"{label}_ap50", "all", round(ap50(matches), 4), positives))
    return float(np.mean([figure.value for figure in figures])), tuple(figures)


def largest_score(net: Path, inputs: Sequence[F32]) -> float:
    """The largest score over inputs of a detector."""
    run = open_network(net, THREADS)
    return max(float(run(x)[:, SCORE_ROWS:].max()) for x in inputs)


def time_networks(
    float_net: Path, int8_net: Path, x: F32, stopwatch: Callable[[], float] = stopwatch_ms, threads: int = THREADS
) -> Timing:
    """Time both networks in turn on one input, so that other load on the machine meets both."""
    runs = [open_network(net, threads) for net in (float_net, int8_net)]
    taken: tuple[list[float], list[float]] = ([], [])
    for turn in range(WARM_UP_RUNS + TIMED_RUNS):
        for run, times in zip(runs, taken, strict=True):
            start_ms = stopwatch()
            run(x)
            if turn >= WARM_UP_RUNS:
                times.append(stopwatch() - start_ms)
    return Timing(round(median(taken[0]), 3), round(median(taken[1]), 3))


def describe_machine() -> str:
    """Processor and architecture, as far as the system names them."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    name = next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), "")
    return f"{name or 'unnamed processor'}, {platform.machine()}"
