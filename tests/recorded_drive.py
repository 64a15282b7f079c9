"""Drives of a simulated hull whose coefficients are known, as messages and as a recording."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from paani import keys
from paani import messages as m
from paani.config import PlantConfig
from paani_sim.plant.plant import Plant
from paani_sim.plant.reference_model import Manoeuvre, build_open_water
from paani_sim.plant.telemetry import gps_message, imu_message
from tests.unit.paani.logs import small_logs

FORCE_PER_UNIT_N, CURRENT_MPS = 75.0, 0.15
STEPS_PER_SAMPLE = 4  # of the IMU: the plant's own step is a quarter of it, so that its truth is its coefficients
SAMPLE_S = 0.01
SAMPLE_US, APPLIED_EVERY, FIX_EVERY = 10_000, 5, 20
Levels = tuple[tuple[float, float, float], ...]  # seconds, left and right, normalised


class Messages(NamedTuple):
    applied: list[m.ThrustApplied]
    odometry: list[m.Odometry]
    fixes: list[m.GpsFix]
    samples: list[m.ImuSample]


def rich_levels(seconds: float, seed: int) -> Levels:
    """Several speeds and turns of both sides, each held for 4 to 10 s."""
    rng, levels, total_s = np.random.default_rng(seed), list[tuple[float, float, float]](), 0.0
    while total_s < seconds:
        hold_s = float(rng.choice([4.0, 7.0, 10.0]))
        ahead = float(rng.choice([0.0, 0.03, 0.06, 0.1, 0.15, 0.2]))
        turn = float(rng.choice([0.0, 0.02, -0.02, 0.05, -0.05]))
        levels.append((hold_s, ahead - turn, ahead + turn))
        total_s += hold_s
    return tuple(levels)


def drive(vessel: str, levels: Levels, seed: int, quadratic_n: float = 0.0) -> Messages:
    """Calm water with a steady current; heading from the compass, as of an estimator that trusts it.

    A fan pushes with `FORCE_PER_UNIT_N` x + `quadratic_n` |x| x.
    """
    world = build_open_water(Manoeuvre("drive", 1.0, 0.0, 0.0, CURRENT_MPS, 1.0))
    plant = Plant(world, PlantConfig(vessel=vessel, step_s=SAMPLE_S / STEPS_PER_SAMPLE), seed)
    plant.place(0.0, 0.0, 0.0)
    messages = Messages([], [], [], [])
    try:
        for number, (since_us, left, right) in enumerate(_thrust_by_sample(levels)):
            now_us = small_logs.START_US + number * SAMPLE_US
            if number % APPLIED_EVERY == 0:
                messages.applied.append(
                    m.ThrustApplied(
                        source_us=now_us, left=left, right=right, left_n=FORCE_PER_UNIT_N * left,
                        right_n=FORCE_PER_UNIT_N * right, zero_cause=m.ZeroCause.NONE, since_us=since_us,
                    )
                )  # fmt: skip
            for _ in range(STEPS_PER_SAMPLE):
                plant.step(*((FORCE_PER_UNIT_N + quadratic_n * abs(x)) * x for x in (left, right)))
            sample = imu_message(plant, now_us + SAMPLE_US)
            messages.samples.append(sample)
            if number % APPLIED_EVERY == 0:
                messages.odometry.append(
                    m.Odometry(
                        source_us=sample.source_us,
                        x_m=0.0,
                        y_m=0.0,
                        yaw_rad=sample.yaw_rad,
                        surge_mps=0.0,
                        healthy=True,
                    )
                )
            if number % FIX_EVERY == 0:
                messages.fixes.append(gps_message(plant, sample.source_us))
    finally:
        plant.close()
    return messages


def record(folder: Path, messages: Messages) -> Path:
    """The messages as the recorder writes them."""
    log = small_logs.begin(folder)
    topics: tuple[keys.Topic[Any], ...] = (keys.THRUST_APPLIED, keys.ODOMETRY, keys.GPS, keys.IMU)
    parts: tuple[Sequence[m.Message], ...] = messages
    everything: list[tuple[int, keys.Topic[Any], m.Message]] = [
        (each.source_us, topic, each) for topic, part in zip(topics, parts, strict=True) for each in part
    ]
    for number, (stamp_us, topic, message) in enumerate(sorted(everything, key=lambda entry: entry[0])):
        sent = topic.stamp(message, domain=message.domain, seq=number, epoch=5, sent_us=stamp_us)
        small_logs.put(log, topic, sent)
    log.finish({})
    return log.path


def _odometry(sample: m.ImuSample) -> m.Odometry:
    return m.Odometry(source_us=sample.source_us, x_m=0.0, y_m=0.0, yaw_rad=sample.yaw_rad, surge_mps=0.0, healthy=True)


def _thrust_by_sample(levels: Levels) -> Iterator[tuple[int, float, float]]:
    """Since when [us], and the thrust, at each sample of the IMU."""
    number = 0
    for seconds, left, right in levels:
        since_us = small_logs.START_US + number * SAMPLE_US
        for _ in range(round(seconds / SAMPLE_S)):
            yield since_us, left, right
            number += 1
