"""Apparent motion of one track: approaching, receding or steady, from the growth of its box. Pure.

Least-squares slope of the logarithm of its size over a sliding window, with a margin from the residuals, compared with
a dead band (I1-I9). It is a diagnosis: no direction and no risk depends on it (I20). The margin is not statistically
calibrated, and the confidence is not a probability (I21).
"""

import math
import statistics
from typing import NamedTuple

import msgspec

from paani import portable
from paani.config import MotionConfig
from paani.geometry import clip
from paani.messages import BoxXyxy, MotionCause, MotionState

MIN_VARIANCE_S2 = 1e-9  # sum of squared times; below it all samples have one time and no slope


class SizeSample(msgspec.Struct, frozen=True):
    """One size of a box: time, y = log sqrt(area) (I1), width over height, confidence of the detection."""

    at_us: int
    log_size: float
    aspect: float
    confidence: float


class MotionHistory(msgspec.Struct, frozen=True, rename={"reset_cause": "reset", "outliers": "odd"}):
    """Samples since the last reset, oldest first, and the cause of that reset while there are too few samples.

    `outliers`: the newest samples of another aspect ratio, as long as they are too few to begin again with them.
    """

    samples: tuple[SizeSample, ...] = ()
    reset_cause: MotionCause = MotionCause.NONE
    outliers: tuple[SizeSample, ...] = ()


class SizeMeasurement(NamedTuple):
    """A detection of the tracked box. `ambiguous`: it could belong to another track as well."""

    at_us: int
    box: BoxXyxy
    log_size: float
    confidence: float
    ambiguous: bool


class Window(NamedTuple):
    """Length of the sliding window, and the longest gap between two samples."""

    history_s: float
    max_gap_s: float


class MotionEstimate(msgspec.Struct, frozen=True):
    """Growth of log size [1/s] with its margin; `state` is UNKNOWN exactly when `cause` is not NONE."""

    state: MotionState
    cause: MotionCause
    rate_per_s: float = 0.0
    margin_per_s: float = 0.0
    confidence: float = 0.0


def motion_window(period_s: float, config: MotionConfig) -> Window:
    """The configured window; `follow_rate` stretches it to a number of frame periods, so that slow cameras fill it."""
    if not config.follow_rate:
        return Window(config.history_s, config.max_gap_s)
    return Window(
        max(config.history_s, config.history_periods * period_s),
        max(config.max_gap_s, config.gap_periods * period_s),
    )


def add_measurement(
    history: MotionHistory, measurement: SizeMeasurement, window: Window, config: MotionConfig
) -> MotionHistory:
    """Add one measurement to the history, or reset the history where the two cannot be compared (I10-I16).

    A clipped, weak or ambiguous measurement resets the history and is not kept; after any other reset it is the first.
    """
    at_us, box = measurement.at_us, measurement.box
    if is_clipped(box, config.edge_margin):
        return MotionHistory(reset_cause=MotionCause.CLIPPED_BY_FRAME)
    if measurement.confidence < config.min_detection_confidence:
        return MotionHistory(reset_cause=MotionCause.WEAK_DETECTION)
    if measurement.ambiguous:
        return MotionHistory(reset_cause=MotionCause.AMBIGUOUS_ASSOCIATION)
    sample = SizeSample(at_us, measurement.log_size, (box[2] - box[0]) / (box[3] - box[1]), measurement.confidence)
    if history.samples:
        last = history.samples[-1]
        gap_s = (at_us - last.at_us) * 1e-6
        if gap_s <= 0.0:
            return MotionHistory((sample,), MotionCause.TIME_REVERSED)
        if gap_s > window.max_gap_s:
            return MotionHistory((sample,), MotionCause.GAP)
        if _has_other_shape(sample, last, config):
            outliers = (*(s for s in history.outliers if not _has_other_shape(sample, s, config)), sample)
            if len(outliers) >= config.shape_change_hits:
                return MotionHistory(outliers, MotionCause.SHAPE_CHANGE)
            return MotionHistory(history.samples, history.reset_cause, outliers)
    oldest_us = at_us - round(window.history_s * 1e6)
    kept = tuple(s for s in (*history.samples, sample) if s.at_us >= oldest_us)[-config.max_samples :]
    return MotionHistory(kept, history.reset_cause if len(kept) < config.min_samples else MotionCause.NONE)


def estimate_motion(history: MotionHistory, at_us: int, window: Window, config: MotionConfig) -> MotionEstimate:
    """Estimate the growth rate by least squares and classify it against the dead band (I1-I9).

    at_us: time of the newest frame; a track unseen for longer than the gap is unknown, whatever it did before.
    """
    samples = history.samples
    if len(samples) < config.min_samples:
        return _unknown_motion(
            history.reset_cause if history.reset_cause != MotionCause.NONE else MotionCause.TOO_FEW_SAMPLES
        )
    if (at_us - samples[-1].at_us) * 1e-6 > window.max_gap_s:
        return _unknown_motion(MotionCause.GAP)
    duration_s = (samples[-1].at_us - samples[0].at_us) / 1e6  # correctly rounded: 400 ms are no less than 0.4 s
    if duration_s < config.min_duration_s:
        return _unknown_motion(MotionCause.TOO_SHORT)
    times_s = [(s.at_us - samples[0].at_us) * 1e-6 for s in samples]
    sizes = [s.log_size for s in samples]
    mean_s, mean_size = statistics.fmean(times_s), statistics.fmean(sizes)
    s_tt = math.fsum((t - mean_s) * (t - mean_s) for t in times_s)
    if s_tt < MIN_VARIANCE_S2:
        return _unknown_motion(MotionCause.TOO_SHORT)
    beta = math.fsum((t - mean_s) * (y - mean_size) for t, y in zip(times_s, sizes, strict=True)) / s_tt
    residuals = [y - mean_size - beta * (t - mean_s) for t, y in zip(times_s, sizes, strict=True)]
    sse = math.fsum(residual * residual for residual in residuals)
    margin = max(config.margin_floor_per_s, config.margin_factor * math.sqrt(sse / ((len(samples) - 2) * s_tt)))
    quality = (
        clip(duration_s / config.full_duration_s, 0.0, 1.0)
        * clip(len(samples) / config.full_samples, 0.0, 1.0)
        * clip(min(s.confidence for s in samples) / config.full_detection_confidence, 0.0, 1.0)
        * clip(config.deadband_per_s / margin, 0.0, 1.0)
    )
    state, cause = _classify(beta, margin, config.deadband_per_s), MotionCause.NONE
    if quality < config.min_quality:
        state, cause = MotionState.UNKNOWN, MotionCause.LOW_QUALITY
    elif state is MotionState.UNKNOWN:
        cause = MotionCause.AMBIGUOUS_INTERVAL
    known = state is not MotionState.UNKNOWN
    return MotionEstimate(state, cause, beta, margin, min(quality, config.max_confidence) if known else 0.0)


def _has_other_shape(a: SizeSample, b: SizeSample, config: MotionConfig) -> bool:
    return abs(portable.log(a.aspect / b.aspect)) > config.max_aspect_change


def is_clipped(box: BoxXyxy, margin: float) -> bool:
    """Whether the box touches the edge of the picture, so that its size is that of its visible part only."""
    return min(box[0], box[1]) <= margin or max(box[2], box[3]) >= 1.0 - margin


def _classify(beta: float, margin: float, deadband: float) -> MotionState:
    if beta - margin > deadband:
        return MotionState.APPROACHING
    if beta + margin < -deadband:
        return MotionState.RECEDING
    if beta - margin >= -deadband and beta + margin <= deadband:
        return MotionState.STEADY
    return MotionState.UNKNOWN


def _unknown_motion(cause: MotionCause) -> MotionEstimate:
    return MotionEstimate(MotionState.UNKNOWN, cause)
