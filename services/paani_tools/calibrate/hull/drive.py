"""A recorded drive as arrays: the thrust that was applied, and what GPS, IMU and localization measured."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np

from paani import keys
from paani.arrays import F64
from paani.errors import UserError
from paani.logs.reader import open_log
from paani.messages import GpsFix, ImuSample, Odometry, ThrustApplied, ZeroCause
from paani.undecodable import UNDECODABLE
from paani_tools.progress import Progress

STEP_S = 0.05  # of the simulation below: a sixth of the shortest time constant of the hulls that ship, or less
MIN_DRIVE_S = 60.0
MAX_GAP_S = 1.0  # of thrust, heading or rate: longer, and nobody knows what the boat was told or did
TOPICS: tuple[keys.Topic[Any], ...] = (keys.THRUST_APPLIED, keys.ODOMETRY, keys.GPS, keys.IMU)


class Drive(NamedTuple):
    """One drive on a grid of `STEP_S` from its start.

    thrust: mean normalised thrust of left and right fan in each step [n, 2]. heading_rad: at the start of each step,
    unwrapped [n]. yaw_rate_radps: mean of the gyro's samples of each step that has any [j]. velocity_mps: of the fixes
    of the GPS, east and north [k, 2]. rate_at, fix_at: when that was, in steps from the start, fractions included.
    """

    thrust: F64
    heading_rad: F64
    rate_at: F64
    yaw_rate_radps: F64
    fix_at: F64
    velocity_mps: F64

    @property
    def seconds(self) -> float:
        return len(self.thrust) * STEP_S


def read_drive(path: Path) -> Drive:
    """The drive in a recording. Raises UserError naming the file and what it lacks."""
    log = open_log(path)
    found: dict[str, list[Any]] = {topic.name: [] for topic in TOPICS}
    decoders = {topic.name: msgspec.json.Decoder(topic.type) for topic in TOPICS}
    span_us = max(1, log.end_us - log.start_us)
    with Progress("reading") as bar:
        for record in log.records(found):
            bar.at((record.log_us - log.start_us) / span_us)
            with contextlib.suppress(*UNDECODABLE):
                found[record.topic].append(decoders[record.topic].decode(record.data))
    for name, messages in found.items():
        if not messages:
            raise UserError(f"{path}: no {name} in it")
    try:
        return drive_of(*found.values())
    except UserError as error:
        raise UserError(f"{path}: {error}") from error


def drive_of(
    applied: Sequence[ThrustApplied],
    odometry: Sequence[Odometry],
    fixes: Sequence[GpsFix],
    samples: Sequence[ImuSample],
) -> Drive:
    """The messages of a drive on one grid. Raises UserError for a drive that is too short, has holes, or
    was driven by radio.
    """
    healthy = sorted((o for o in odometry if o.healthy), key=lambda o: o.source_us)
    if not healthy:
        raise UserError(f"no healthy {keys.ODOMETRY.name}: the boat's heading is not known")
    thrust, gyro = _thrust_changes(applied), np.array(sorted((s.source_us, s.gyro_z_radps) for s in samples))
    heading_us = np.array([o.source_us for o in healthy], np.float64)
    begin_us = max(thrust[0, 0], heading_us[0], gyro[0, 0])
    end_us = min(max(a.source_us for a in applied), heading_us[-1], gyro[-1, 0])
    steps = int((end_us - begin_us) * 1e-6 / STEP_S)
    if steps * STEP_S < MIN_DRIVE_S:
        raise UserError(
            f"{max(0.0, steps * STEP_S):.0f} s with thrust, heading and gyro together; at least {MIN_DRIVE_S:.0f} s"
        )
    for message in applied:
        if message.zero_cause is ZeroCause.RECEIVER and begin_us <= message.source_us <= end_us:
            at_s = (message.source_us - begin_us) * 1e-6
            raise UserError(f"the radio receiver drove, {at_s:.0f} s into the drive: its thrust is not recorded")
    edges_us = begin_us + np.arange(steps + 1) * STEP_S * 1e6
    for topic, stamps_us in (
        (keys.THRUST_APPLIED, np.array(sorted(a.source_us for a in applied), np.float64)),
        (keys.ODOMETRY, heading_us),
        (keys.IMU, gyro[:, 0]),
    ):
        _require_no_hole(topic.name, stamps_us, begin_us, end_us)
    heading = np.unwrap([o.yaw_rad for o in healthy])
    usable = [f for f in fixes if f.fix and begin_us <= f.source_us < edges_us[-1]]
    if len(usable) < MIN_DRIVE_S:
        raise UserError(f"{len(usable)} fixes of {keys.GPS.name}; at least one a second is needed")
    mean_us, rates = _bin_means(edges_us, gyro)
    return Drive(
        thrust=np.column_stack([_step_means(edges_us, thrust[:, 0], thrust[:, side]) for side in (1, 2)]),
        heading_rad=np.interp(edges_us[:-1], heading_us, heading),
        rate_at=(mean_us - begin_us) * 1e-6 / STEP_S,
        yaw_rate_radps=rates,
        fix_at=(np.array([f.source_us for f in usable]) - begin_us) * 1e-6 / STEP_S,
        velocity_mps=np.array([(f.sog_mps * math.cos(f.cog_rad), f.sog_mps * math.sin(f.cog_rad)) for f in usable]),
    )


def _thrust_changes(applied: Sequence[ThrustApplied]) -> F64:
    """When the thrust changed [us], and what it was from then on, left and right [n, 3].

    A change lies between two messages; `since_us` says when, where the plant's clock allows it.
    """
    rows: list[tuple[float, float, float]] = []
    before_us = 0
    for message in sorted(applied, key=lambda a: a.source_us):
        if not rows or (message.left, message.right) != rows[-1][1:]:
            within = before_us < message.since_us <= message.source_us
            rows.append((message.since_us if rows and within else message.source_us, message.left, message.right))
        before_us = message.source_us
    return np.array(rows, np.float64)


def _step_means(edges_us: F64, changed_us: F64, values: F64) -> F64:
    """Mean of a value that holds from each change to the next, over each step."""
    integral = np.concatenate([[0.0], np.cumsum(values[:-1] * np.diff(changed_us))])
    at = np.searchsorted(changed_us, edges_us, side="right") - 1
    upto = integral[at] + values[at] * (edges_us - changed_us[at])
    means: F64 = np.diff(upto) / np.diff(edges_us)
    return means


def _bin_means(edges_us: F64, samples: F64) -> F64:
    """Mean time and mean value of the samples [n, 2] in each step that has any [2, j]."""
    inside = np.searchsorted(edges_us, samples[:, 0], side="right") - 1
    kept = (inside >= 0) & (inside < len(edges_us) - 1)
    count = np.bincount(inside[kept], minlength=len(edges_us) - 1)
    sums = [np.bincount(inside[kept], weights=column[kept] - column[0]) for column in samples.T]
    means: F64 = np.stack([total[count > 0] / count[count > 0] for total in sums]) + samples[0][:, None]
    return means


def _require_no_hole(topic: str, stamps_us: F64, begin_us: float, end_us: float) -> None:
    inside = stamps_us[(stamps_us >= begin_us) & (stamps_us <= end_us)]
    gaps_s = np.diff(np.concatenate([[begin_us], inside, [end_us]])) * 1e-6
    if gaps_s.max() > MAX_GAP_S:
        at_s = (np.concatenate([[begin_us], inside])[gaps_s.argmax()] - begin_us) * 1e-6
        raise UserError(f"no {topic} for {gaps_s.max():.1f} s, {at_s:.0f} s into the drive; name a recording without")
