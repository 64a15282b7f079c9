"""Levelling: acceleration and yaw rate of a tilted IMU on level axes, without gravity. Pure."""

import math
from collections.abc import Sequence
from typing import NamedTuple

from paani.messages import ImuSample

MIN_COS_PITCH = 0.5  # 60 degrees of pitch; keeps the yaw rate finite for a boat that stands on its stern


class LevelMotion(NamedTuple):
    """Acceleration ahead and to the left without gravity [m/s^2], and yaw rate about the vertical [rad/s]."""

    ahead_mps2: float
    left_mps2: float
    yaw_rate_radps: float


def level_sample(sample: ImuSample) -> LevelMotion:
    """Turn one sample back by its own roll and pitch, so that gravity has no component along the level axes."""
    sin_roll, cos_roll = math.sin(sample.roll_rad), math.cos(sample.roll_rad)
    sin_pitch, cos_pitch = math.sin(sample.pitch_rad), math.cos(sample.pitch_rad)
    up_mps2 = sample.accel_y_mps2 * sin_roll + sample.accel_z_mps2 * cos_roll
    rate_radps = sample.gyro_y_radps * sin_roll + sample.gyro_z_radps * cos_roll
    return LevelMotion(
        sample.accel_x_mps2 * cos_pitch + up_mps2 * sin_pitch,
        sample.accel_y_mps2 * cos_roll - sample.accel_z_mps2 * sin_roll,
        rate_radps / max(cos_pitch, MIN_COS_PITCH),
    )


def mean_level_motion(samples: Sequence[ImuSample]) -> LevelMotion:
    """The mean over at least one sample."""
    ahead_mps2, left_mps2, rate_radps = zip(*map(level_sample, samples), strict=True)
    n = len(samples)
    return LevelMotion(sum(ahead_mps2) / n, sum(left_mps2) / n, sum(rate_radps) / n)
