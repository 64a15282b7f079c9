"""What a tilted IMU feels, on level axes. Pure."""

import math
from collections.abc import Sequence
from typing import NamedTuple

from paani.messages import ImuSample


class Level(NamedTuple):
    """Acceleration ahead and to the left without gravity [m/s^2], and yaw rate [rad/s], about the vertical."""

    ahead_mps2: float
    left_mps2: float
    yaw_rate_radps: float


def level(sample: ImuSample) -> Level:
    """One sample turned by its own roll and pitch, so that gravity leaves no trace along the level axes."""
    sin_roll, cos_roll = math.sin(sample.roll_rad), math.cos(sample.roll_rad)
    sin_pitch, cos_pitch = math.sin(sample.pitch_rad), math.cos(sample.pitch_rad)
    down = sample.accel_y_mps2 * sin_roll + sample.accel_z_mps2 * cos_roll
    rate = sample.gyro_y_radps * sin_roll + sample.gyro_z_radps * cos_roll
    return Level(
        sample.accel_x_mps2 * cos_pitch + down * sin_pitch,
        sample.accel_y_mps2 * cos_roll - sample.accel_z_mps2 * sin_roll,
        rate / max(cos_pitch, 0.5),
    )


def mean_level(samples: Sequence[ImuSample]) -> Level:
    """The mean of at least one sample."""
    ahead, left, rate = zip(*map(level, samples), strict=True)
    n = len(samples)
    return Level(sum(ahead) / n, sum(left) / n, sum(rate) / n)
