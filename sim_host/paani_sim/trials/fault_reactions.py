"""Reaction of the boat to camera faults: when it was noticed, fans off, and at rest. Pure."""

from __future__ import annotations

from collections.abc import Sequence

from paani_sim.trials.drive_history import DriveHistory, DriveSample, ThrustChange
from paani_sim.trials.lockstep_bus import START_US
from paani_sim.trials.result import Reaction
from paani_sim.worlds import Fault, FaultKind

REST_MPS = 0.05
REACTION_LIMIT_S = 0.5  # s, in addition to one frame
CAMERA_FAULTS = frozenset(
    (FaultKind.CAMERA_BLACK, FaultKind.CAMERA_FROZEN, FaultKind.CAMERA_BLURRED, FaultKind.CAMERA_DROPPED)
)


def measure_reactions(faults: Sequence[Fault], history: DriveHistory, frame_s: float) -> tuple[Reaction, ...]:
    """Measure the reaction to every camera fault that began while the boat was armed. frame_s: period of pictures."""
    if not history.samples:
        return ()
    first_s, last_s = history.samples[0].t_s, history.samples[-1].t_s
    return tuple(
        _measure_reaction(fault, history, frame_s)
        for fault in faults
        if fault.kind in CAMERA_FAULTS and first_s <= fault.start_s <= last_s
    )


def _measure_reaction(fault: Fault, history: DriveHistory, frame_s: float) -> Reaction:
    start_us = START_US + round(fault.start_s * 1e6)
    end_s = min(fault.start_s + fault.duration_s, history.samples[-1].t_s)
    noticed = [stamp_us for stamp_us, _ in history.unusable_frames if stamp_us >= start_us]
    zero_s = _zero_thrust_delay_s(history.thrust_changes, fault.start_s, end_s)
    return Reaction(
        fault=fault.kind.value,
        at_s=round(fault.start_s, 2),
        noticed_s=round((noticed[0] - start_us) * 1e-6, 3) if noticed else None,
        zero_thrust_s=round(zero_s, 3) if zero_s is not None else None,
        rest_s=_rest_delay_s(history.samples, fault.start_s, end_s),
        in_time=zero_s is not None and zero_s <= frame_s + REACTION_LIMIT_S,
    )


def _zero_thrust_delay_s(changes: Sequence[ThrustChange], start_s: float, end_s: float) -> float | None:
    """Time from the start of the fault until the fans were off for the rest of it; None if they were not."""
    since_s: float | None = 0.0  # fans are off before the first thrust
    for change in changes:
        after_s = (change.at_us - START_US) * 1e-6 - start_s
        if after_s >= end_s - start_s:
            break
        if not change.is_zero:
            since_s = None
        elif since_s is None:
            since_s = max(after_s, 0.0)
    return since_s


def _rest_delay_s(samples: Sequence[DriveSample], start_s: float, end_s: float) -> float | None:
    return next(
        (
            round(sample.t_s - start_s, 2)
            for sample in samples
            if start_s <= sample.t_s <= end_s and abs(sample.surge_mps) < REST_MPS
        ),
        None,
    )
