"""Apparent motion of one tracked box: does it grow or shrink? Diagnostic only (I20). Pure.

The slope's margin is not statistically calibrated and the confidence is not a probability (I21).
"""

import math
import statistics
from typing import NamedTuple

import msgspec

from paani import portable
from paani.config import MotionConfig
from paani.geometry import clip
from paani.messages import BoxXyxy, MotionCause, MotionState

MIN_VARIANCE_S2 = 1e-9


class Sample(msgspec.Struct, frozen=True):
    """One sighting: time [us], y = log size (I1), width / height, confidence."""

    at_us: int
    log_size: float
    aspect: float
    confidence: float


class MotionHistory(msgspec.Struct, frozen=True):
    """Samples since the last reset, oldest first, and what caused that reset while too few have come since.

    `odd`: the latest sightings of another shape, not yet enough of them to begin again.
    """

    samples: tuple[Sample, ...] = ()
    reset: MotionCause = MotionCause.NONE
    odd: tuple[Sample, ...] = ()


class Sighting(NamedTuple):
    """A box as it was detected. `ambiguous`: it could have been another object's."""

    at_us: int
    box: BoxXyxy
    log_size: float
    confidence: float
    ambiguous: bool


class Window(NamedTuple):
    """How far back samples reach, and how far apart they may lie [s]."""

    history_s: float
    max_gap_s: float


class Estimate(msgspec.Struct, frozen=True):
    """Growth of log size [1/s] with its margin; `state` is UNKNOWN exactly when `cause` is not NONE."""

    state: MotionState
    cause: MotionCause
    rate_per_s: float = 0.0
    margin_per_s: float = 0.0
    confidence: float = 0.0


def window_for(period_s: float, config: MotionConfig) -> Window:
    """The configured window; `follow_rate` stretches it to the time between frames (resolution 2)."""
    if not config.follow_rate:
        return Window(config.history_s, config.max_gap_s)
    return Window(
        max(config.history_s, config.history_periods * period_s),
        max(config.max_gap_s, config.gap_periods * period_s),
    )


def observe(history: MotionHistory, sighting: Sighting, window: Window, config: MotionConfig) -> MotionHistory:
    """Add one sighting of a box, or begin again where it cannot be compared with those before (I10-I16).

    A sighting that is itself unfit (clipped, weak, ambiguous) is not kept; any other reset keeps it as the first.
    """
    at_us, box = sighting.at_us, sighting.box
    if is_clipped(box, config.edge_margin):
        return MotionHistory(reset=MotionCause.CLIPPED_BY_FRAME)
    if sighting.confidence < config.min_detection_confidence:
        return MotionHistory(reset=MotionCause.WEAK_DETECTION)
    if sighting.ambiguous:
        return MotionHistory(reset=MotionCause.AMBIGUOUS_ASSOCIATION)
    sample = Sample(at_us, sighting.log_size, (box[2] - box[0]) / (box[3] - box[1]), sighting.confidence)
    if history.samples:
        last = history.samples[-1]
        gap_s = (at_us - last.at_us) * 1e-6
        if gap_s <= 0.0:
            return MotionHistory((sample,), MotionCause.TIME_REVERSED)
        if gap_s > window.max_gap_s:
            return MotionHistory((sample,), MotionCause.GAP)
        if _differs(sample, last, config):
            odd = (*(s for s in history.odd if not _differs(sample, s, config)), sample)
            if len(odd) >= config.shape_change_hits:
                return MotionHistory(odd, MotionCause.SHAPE_CHANGE)
            return MotionHistory(history.samples, history.reset, odd)
    oldest_us = at_us - round(window.history_s * 1e6)
    kept = tuple(s for s in (*history.samples, sample) if s.at_us >= oldest_us)[-config.max_samples :]
    return MotionHistory(kept, history.reset if len(kept) < config.min_samples else MotionCause.NONE)


def estimate(history: MotionHistory, at_us: int, window: Window, config: MotionConfig) -> Estimate:
    """Least-squares growth with its margin, judged against the dead band (I1-I9).

    at_us: time of the newest frame; what was not seen for longer than the gap is unknown, whatever it did before.
    """
    samples = history.samples
    if len(samples) < config.min_samples:
        return _unknown(history.reset if history.reset != MotionCause.NONE else MotionCause.TOO_FEW_SAMPLES)
    if (at_us - samples[-1].at_us) * 1e-6 > window.max_gap_s:
        return _unknown(MotionCause.GAP)
    duration_s = (samples[-1].at_us - samples[0].at_us) * 1e-6
    if duration_s < config.min_duration_s:
        return _unknown(MotionCause.TOO_SHORT)
    times_s = [(s.at_us - samples[0].at_us) * 1e-6 for s in samples]
    sizes = [s.log_size for s in samples]
    mean_s, mean_size = statistics.fmean(times_s), statistics.fmean(sizes)
    s_tt = math.fsum((t - mean_s) * (t - mean_s) for t in times_s)
    if s_tt < MIN_VARIANCE_S2:
        return _unknown(MotionCause.TOO_SHORT)
    beta = math.fsum((t - mean_s) * (y - mean_size) for t, y in zip(times_s, sizes, strict=True)) / s_tt
    rests = [y - mean_size - beta * (t - mean_s) for t, y in zip(times_s, sizes, strict=True)]
    sse = math.fsum(rest * rest for rest in rests)
    margin = max(config.margin_floor_per_s, config.margin_factor * math.sqrt(sse / ((len(samples) - 2) * s_tt)))
    quality = (
        clip(duration_s / config.full_duration_s, 0.0, 1.0)
        * clip(len(samples) / config.full_samples, 0.0, 1.0)
        * clip(min(s.confidence for s in samples) / config.full_detection_confidence, 0.0, 1.0)
        * clip(config.deadband_per_s / margin, 0.0, 1.0)
    )
    state, cause = _state(beta, margin, config.deadband_per_s), MotionCause.NONE
    if quality < config.min_quality:
        state, cause = MotionState.UNKNOWN, MotionCause.LOW_QUALITY
    elif state is MotionState.UNKNOWN:
        cause = MotionCause.AMBIGUOUS_INTERVAL
    known = state is not MotionState.UNKNOWN
    return Estimate(state, cause, beta, margin, min(quality, config.max_confidence) if known else 0.0)


def _differs(a: Sample, b: Sample, config: MotionConfig) -> bool:
    return abs(portable.log(a.aspect / b.aspect)) > config.max_aspect_change


def is_clipped(box: BoxXyxy, margin: float) -> bool:
    """Does the box touch the picture's edge, so that its size says nothing?"""
    return min(box[0], box[1]) <= margin or max(box[2], box[3]) >= 1.0 - margin


def _state(beta: float, margin: float, deadband: float) -> MotionState:
    if beta - margin > deadband:
        return MotionState.APPROACHING
    if beta + margin < -deadband:
        return MotionState.RECEDING
    if beta - margin >= -deadband and beta + margin <= deadband:
        return MotionState.STEADY
    return MotionState.UNKNOWN


def _unknown(cause: MotionCause) -> Estimate:
    return Estimate(MotionState.UNKNOWN, cause)
