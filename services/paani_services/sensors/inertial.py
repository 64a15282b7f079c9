"""Samples of inertial units: PQTMIMU (acceleration and rates alone) and VNYMR (with orientation). Pure.

Both are published formats: PQTMIMU of Quectel's dead-reckoning receivers, VNYMR of VectorNav's VN-100 and VN-200. A
sketch for an MPU6050 writes the first, one for a 9-axis chip the second. The README has their fields, units and axes.
"""

import math
from typing import NamedTuple

import numpy as np

from paani.arrays import F64
from paani.messages import ImuSample
from paani_services.sensors.sentences import Sentence, course_rad

MAX_ACCEL_MPS2, MAX_RATE_RADPS = 160.0, 35.0  # the widest ranges of small IMUs: 16 g, 2000 degrees a second

Vector = tuple[float, float, float]


class InertialSample(NamedTuple):
    """One sample on the sensor's axes, x forward, y left, z up; before it is turned to the boat's axes.

    `attitude_rad`: roll, pitch and yaw of the sensor in the map, None of a unit that gives none. `device_ms`: the
    unit's own clock, None of a unit that does not tell.
    """

    accel_mps2: Vector
    gyro_radps: Vector
    attitude_rad: Vector | None = None
    device_ms: int | None = None


def read_sample(sentence: Sentence) -> InertialSample:
    """The sample of a PQTMIMU or VNYMR sentence. Raises ValueError for an empty or impossible field."""
    if sentence.kind == "PQTMIMU":
        return InertialSample(
            _vector(sentence, ("accX", "accY", "accZ"), 1.0, MAX_ACCEL_MPS2),
            _vector(sentence, ("angrateX", "angrateY", "angrateZ"), math.radians(1.0), MAX_RATE_RADPS),
            device_ms=int(_required(sentence, "timestamp", 0.0)),
        )
    ahead_mps2, right_mps2, down_mps2 = _vector(sentence, ("accX", "accY", "accZ"), 1.0, MAX_ACCEL_MPS2)
    roll_radps, pitch_radps, yaw_radps = _vector(sentence, ("gyroX", "gyroY", "gyroZ"), 1.0, MAX_RATE_RADPS)
    heading_deg = _required(sentence, "yaw", -360.0, 360.0)
    pitch_deg, roll_deg = _required(sentence, "pitch", -90.0, 90.0), _required(sentence, "roll", -180.0, 180.0)
    return InertialSample(
        (ahead_mps2, -right_mps2, -down_mps2),
        (roll_radps, -pitch_radps, -yaw_radps),
        (math.radians(roll_deg), -math.radians(pitch_deg), course_rad(heading_deg)),
    )


class Mounting:
    """Turns samples from the sensor's axes to the boat's: how the sensor is mounted, as roll, pitch and yaw."""

    def __init__(self, roll_deg: float, pitch_deg: float, yaw_deg: float) -> None:
        self._is_straight = roll_deg == pitch_deg == yaw_deg == 0.0
        self._boat_from_sensor = rotation(math.radians(roll_deg), math.radians(pitch_deg), math.radians(yaw_deg))

    def turn(self, sample: InertialSample) -> InertialSample:
        """The same sample on the boat's axes."""
        if self._is_straight:
            return sample
        attitude_rad = sample.attitude_rad
        if attitude_rad is not None:
            attitude_rad = euler_rad(rotation(*attitude_rad) @ self._boat_from_sensor.T)
        return InertialSample(
            self._turned(sample.accel_mps2), self._turned(sample.gyro_radps), attitude_rad, sample.device_ms
        )

    def _turned(self, vector: Vector) -> Vector:
        x, y, z = (self._boat_from_sensor @ np.array(vector)).tolist()
        return x, y, z


def imu_message(sample: InertialSample, at_us: int, yaw_rad: float | None) -> ImuSample:
    """The message of a sample on the boat's axes. Without a yaw the orientation is marked unavailable (A12)."""
    roll_rad, pitch_rad, _ = sample.attitude_rad or (0.0, 0.0, 0.0)
    return ImuSample(
        source_us=at_us,
        gyro_x_radps=sample.gyro_radps[0],
        gyro_y_radps=sample.gyro_radps[1],
        gyro_z_radps=sample.gyro_radps[2],
        accel_x_mps2=sample.accel_mps2[0],
        accel_y_mps2=sample.accel_mps2[1],
        accel_z_mps2=sample.accel_mps2[2],
        orientation_available=yaw_rad is not None,
        roll_rad=roll_rad,
        pitch_rad=pitch_rad,
        yaw_rad=0.0 if yaw_rad is None else yaw_rad,
    )


def rotation(roll_rad: float, pitch_rad: float, yaw_rad: float) -> F64:
    """Rotation matrix [3, 3] about z, then y, then x, of intrinsic angles (yaw, pitch, roll)."""
    (sr, sp, sy), (cr, cp, cy) = np.sin((roll_rad, pitch_rad, yaw_rad)), np.cos((roll_rad, pitch_rad, yaw_rad))
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def euler_rad(matrix: F64) -> Vector:
    """Roll, pitch and yaw of a rotation matrix [3, 3]; inverse of `rotation`."""
    return (
        math.atan2(matrix[2, 1], matrix[2, 2]),
        math.asin(max(-1.0, min(1.0, -matrix[2, 0]))),
        math.atan2(matrix[1, 0], matrix[0, 0]),
    )


def _vector(sentence: Sentence, names: tuple[str, str, str], scale: float, limit: float) -> Vector:
    x, y, z = (_required(sentence, name, -limit / scale, limit / scale) * scale for name in names)
    return x, y, z


def _required(sentence: Sentence, name: str, low: float = -1e9, high: float = 1e9) -> float:
    value = sentence.number(name, low, high)
    if value is None:
        raise ValueError(f"{sentence.kind} {name}: empty")
    return value
