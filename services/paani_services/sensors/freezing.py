"""Whether a sensor is frozen: it goes on talking, and says the same. Told from a sensor that rests. Pure.

A receiver at rest may repeat its position, but its time goes on and its speed is about zero. A sample of an inertial
unit at rest has noise in its last digits, and so has each echo of a range scanner. A compass at rest may repeat its
heading, but then the gyro does not turn.
"""

import math

from paani.messages import GpsFix
from paani_services.sensors.inertial import InertialSample

REPEATED_TIMES = 4  # in a row: more than a receiver that writes RMC for two talkers in turn
# Way by its own speed while the position stays the same to the last digit: twice the step of a position that is
# written with three decimals of a minute.
STOOD_WAY_M = 4.0
STOOD_SPEED_MPS = 0.5  # a receiver at rest shows less, even one that holds its position and not its speed
MAX_FIX_GAP_S = 2.0  # a longer gap between fixes is not counted as way
IDENTICAL_S, IDENTICAL_SAMPLES = 0.5, 5  # noise makes two identical samples rare, and so many impossible
# Turn by the gyro while the heading stays the same to the last digit: ten times the step of a heading in whole degrees.
STOOD_TURN_RAD = 0.17
# Mean specific force of a boat, whatever it does: gravity, and what waves and turns add to it. One that writes g
# instead of m/s^2 has 1.
LEAST_GRAVITY_MPS2, MOST_GRAVITY_MPS2 = 7.0, 13.0
LEAST_UPRIGHT = 0.5  # of gravity, along the mast: 60 degrees of heel, mean and mount together
GRAVITY_SAMPLES = 50  # over which it is averaged: longer than a bump
MAX_GYRO_BIAS_RADPS = 0.1  # of an MPU6050 that nobody calibrated (its data sheet: 5 degrees a second, typically)


class PositionWatch:
    """Finds a receiver whose position stands although its speed says that it moves."""

    def __init__(self) -> None:
        self._last: GpsFix | None = None
        self._way_m = 0.0

    def take(self, fix: GpsFix) -> bool:
        """Whether the receiver is frozen, by this fix and those before it."""
        last, self._last = self._last, fix
        if last is None or (fix.latitude_deg, fix.longitude_deg) != (last.latitude_deg, last.longitude_deg):
            self._way_m = 0.0
        elif fix.fix and fix.sog_mps > STOOD_SPEED_MPS:
            self._way_m += fix.sog_mps * min((fix.source_us - last.source_us) * 1e-6, MAX_FIX_GAP_S)
        return self._way_m > STOOD_WAY_M


class SampleWatch:
    """Finds an inertial unit whose clock stands, or whose samples are all the same to the last digit."""

    def __init__(self) -> None:
        self._last: InertialSample | None = None
        self._same_since_us = 0
        self._same_n = 0

    def take(self, sample: InertialSample, at_us: int) -> bool:
        """Whether the unit is frozen, by this sample and those before it. A repeated time alone freezes at once."""
        last, self._last = self._last, sample
        if last is None or sample._replace(device_ms=None) != last._replace(device_ms=None):
            self._same_since_us, self._same_n = at_us, 0
        else:
            self._same_n += 1
        stands = last is not None and sample.device_ms is not None and sample.device_ms == last.device_ms
        is_same = self._same_n >= IDENTICAL_SAMPLES and (at_us - self._same_since_us) * 1e-6 >= IDENTICAL_S
        return stands or is_same


class HeadingWatch:
    """Finds a compass whose heading stands although the gyro turns."""

    def __init__(self) -> None:
        self._last_rad: float | None = None
        self._turn_rad = 0.0
        self._sample_us = 0

    def take_heading(self, yaw_rad: float) -> None:
        """A new heading; another one than before ends the watch."""
        if yaw_rad != self._last_rad:
            self._last_rad, self._turn_rad = yaw_rad, 0.0

    def take_sample(self, yaw_rate_radps: float, at_us: int) -> bool:
        """Whether the compass is frozen, by this sample of the gyro and those since the heading last changed."""
        since_s, self._sample_us = (at_us - self._sample_us) * 1e-6 if self._sample_us else 0.0, at_us
        excess_radps = max(abs(yaw_rate_radps) - MAX_GYRO_BIAS_RADPS, 0.0)
        if 0.0 < since_s < MAX_FIX_GAP_S and self._last_rad is not None:
            self._turn_rad += excess_radps * since_s * (1.0 if yaw_rate_radps > 0.0 else -1.0)
        return abs(self._turn_rad) > STOOD_TURN_RAD


class GravityWatch:
    """Finds an inertial unit that does not feel gravity: other units than m/s^2, a broken accelerometer, upside down.

    The sign of the gyro is known by it: a unit that stands on its head turns the wrong way.
    """

    def __init__(self) -> None:
        self._mean_mps2 = self._mean_up_mps2 = 0.0
        self._n = 0

    def take(self, sample: InertialSample) -> bool:
        """Whether the mean of the force is none that a boat feels, or comes from beside or above it."""
        self._n = min(self._n + 1, GRAVITY_SAMPLES)
        self._mean_mps2 += (math.hypot(*sample.accel_mps2) - self._mean_mps2) / self._n
        self._mean_up_mps2 += (sample.accel_mps2[2] - self._mean_up_mps2) / self._n
        is_gravity = LEAST_GRAVITY_MPS2 <= self._mean_mps2 <= MOST_GRAVITY_MPS2
        return not is_gravity or self._mean_up_mps2 < LEAST_UPRIGHT * self._mean_mps2


class TurnWatch:
    """Finds a range scanner whose turns are all the same to the last millimetre, and show something."""

    def __init__(self) -> None:
        self._last: tuple[float, ...] = ()
        self._same_n = 0

    def take(self, ranges_m: tuple[float, ...]) -> bool:
        """Whether the scanner is frozen, by this turn and those before it."""
        self._same_n = self._same_n + 1 if ranges_m == self._last and any(ranges_m) else 0
        self._last = ranges_m
        return self._same_n >= REPEATED_TIMES
