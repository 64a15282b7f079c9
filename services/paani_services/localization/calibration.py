"""Gyro bias from the first seconds at rest. Pure."""

import math
import statistics
from collections.abc import Sequence

import msgspec

from paani.messages import ImuSample

REST_RATE_RADPS = 0.02  # no more than the gyro's bias may explain
REST_SPREAD_RADPS = 0.01
MIN_SAMPLES = 20
CALIBRATED_STD_RADPS = 5e-4
UNCALIBRATED_STD_RADPS = 5e-3


class GyroBias(msgspec.Struct, frozen=True):
    """Bias of the yaw rate and how well it is known [rad/s]."""

    radps: float = 0.0
    std_radps: float = UNCALIBRATED_STD_RADPS


def gyro_bias(samples: Sequence[ImuSample]) -> GyroBias:
    """The mean yaw rate if the boat was at rest, else zero and little trust."""
    rates = [sample.gyro_z_radps for sample in samples]
    if len(rates) < MIN_SAMPLES:
        return GyroBias()
    mean = statistics.fmean(rates)
    halves = (rates[: len(rates) // 2], rates[len(rates) // 2 :])
    drift = abs(statistics.fmean(halves[1]) - statistics.fmean(halves[0]))
    turning = abs(mean) > REST_RATE_RADPS or drift > CALIBRATED_STD_RADPS * 4.0
    if turning or statistics.pstdev(rates) > REST_SPREAD_RADPS or not math.isfinite(mean):
        return GyroBias()
    return GyroBias(mean, CALIBRATED_STD_RADPS)
