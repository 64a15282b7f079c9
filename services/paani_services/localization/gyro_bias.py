"""Bias of the gyro's yaw rate, from the first seconds if the boat was at rest in them. Pure."""

import math
import statistics
from collections.abc import Sequence

import msgspec

from paani.messages import ImuSample

MAX_BIAS_RADPS = 0.02  # a larger mean yaw rate is no bias of a small gyro: the boat turned
MAX_NOISE_STD_RADPS = 0.01  # a larger spread of the yaw rate is no noise: the boat was moved
MIN_SAMPLES = 20  # fewer say too little about the mean
CALIBRATED_STD_RADPS = 5e-4  # of a bias measured at rest
UNCALIBRATED_STD_RADPS = 5e-3  # of a bias taken as zero


class GyroBias(msgspec.Struct, frozen=True):
    """Bias of the yaw rate and its standard deviation [rad/s]."""

    radps: float = 0.0
    std_radps: float = UNCALIBRATED_STD_RADPS


def estimate_gyro_bias(samples: Sequence[ImuSample]) -> GyroBias:
    """The mean yaw rate if the boat was at rest, else zero with a large standard deviation.

    A boat at rest has a small mean yaw rate that is the same in both halves, and little spread about it.
    """
    rates_radps = [sample.gyro_z_radps for sample in samples]
    if len(rates_radps) < MIN_SAMPLES:
        return GyroBias()
    mean_radps = statistics.fmean(rates_radps)
    halves = (rates_radps[: len(rates_radps) // 2], rates_radps[len(rates_radps) // 2 :])
    drift_radps = abs(statistics.fmean(halves[1]) - statistics.fmean(halves[0]))
    is_turning = abs(mean_radps) > MAX_BIAS_RADPS or drift_radps > CALIBRATED_STD_RADPS * 4.0
    if is_turning or statistics.pstdev(rates_radps) > MAX_NOISE_STD_RADPS or not math.isfinite(mean_radps):
        return GyroBias()
    return GyroBias(mean_radps, CALIBRATED_STD_RADPS)
