"""Samples of inertial units, on the boat's axes."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from paani_services.localization.levelling import level_sample
from paani_services.sensors.inertial import (
    InertialSample,
    Mounting,
    euler_rad,
    imu_message,
    read_sample,
    rotation,
)
from paani_services.sensors.sentences import ChecksumError, read_sentence
from tests.unit.paani_services.sensors.written import imu_line, sentence

G = 9.80665


def read(line: bytes | str) -> InertialSample:
    _, found = read_sentence(line if isinstance(line, bytes) else line.encode())
    assert found is not None
    return read_sample(found)


def test_a_six_axis_line_is_read_in_metres_and_degrees() -> None:
    sample = read(imu_line(1234, (0.1, -0.2, 9.8), (10.0, -20.0, 90.0)))
    assert sample.accel_mps2 == pytest.approx((0.1, -0.2, 9.8))
    assert sample.gyro_radps == pytest.approx((math.radians(10.0), math.radians(-20.0), math.radians(90.0)))
    assert (sample.device_ms, sample.attitude_rad) == (1234, None)


def test_a12_an_imu_without_compass_has_no_orientation() -> None:
    message = imu_message(read(imu_line(1)), 5, None)
    assert not message.orientation_available
    assert (message.source_us, message.yaw_rad) == (5, 0.0)


def test_a_nine_axis_line_turns_from_down_to_up_and_from_compass_to_map() -> None:
    """A line of a VN-200 with its bow 7.3 degrees down; z down, so that gravity reads -9.7."""
    line = (
        "VNYMR,+100.949,-007.330,+000.715,-00.0049,-00.2449,+00.5397,"
        "-01.258,-00.100,-09.701,-00.000018,+00.001122,-00.000551"
    )
    assert sentence(line).strip().endswith("*69")
    sample = read(sentence(line))
    assert sample.accel_mps2 == pytest.approx((-1.258, 0.1, 9.701))
    assert sample.gyro_radps == pytest.approx((-0.000018, -0.001122, 0.000551))
    assert sample.attitude_rad is not None
    roll_rad, pitch_rad, yaw_rad = sample.attitude_rad
    assert (math.degrees(roll_rad), math.degrees(pitch_rad)) == pytest.approx((0.715, 7.33))
    assert math.degrees(yaw_rad) == pytest.approx(90.0 - 100.949)
    level = level_sample(imu_message(sample, 1, yaw_rad))
    assert (level.ahead_mps2, level.left_mps2) == pytest.approx((0.0, 0.0), abs=0.03)


@pytest.mark.parametrize(("roll_deg", "pitch_deg"), [(5.0, 0.0), (0.0, 5.0), (-8.0, 12.0)])
def test_gravity_and_attitude_of_a_tilted_unit_agree(roll_deg: float, pitch_deg: float) -> None:
    """x forward, y right, z down: nose up and starboard down are positive. Level, nothing of gravity is left."""
    roll, pitch = math.radians(roll_deg), math.radians(pitch_deg)
    force = (G * math.sin(pitch), -G * math.cos(pitch) * math.sin(roll), -G * math.cos(pitch) * math.cos(roll))
    numbers = ",".join(f"{number:.6f}" for number in force)
    sample = read(sentence(f"VNYMR,0.0,{pitch_deg},{roll_deg},0,0,0,{numbers},0,0,0"))
    level = level_sample(imu_message(sample, 1, 0.0))
    assert (level.ahead_mps2, level.left_mps2) == pytest.approx((0.0, 0.0), abs=1e-4)


@pytest.mark.parametrize(
    "body",
    [
        "PQTMIMU,1,2,3",
        "PQTMIMU,1,,0,1,0,0,0,0,0",
        "PQTMIMU,1,nan,0,1,0,0,0,0,0",
        "PQTMIMU,1,161,0,1,0,0,0,0,0",
        "PQTMIMU,1,0,0,1,0,0,2100,0,0",
        "PQTMIMU,x,0,0,1,0,0,0,0,0",
        "VNYMR,1,2,3,4,5,6,7,8,9,10,11",
        "VNYMR,400,0,0,0,0,0,0,0,-9.8,0,0,0",
        "VNYMR,0,100,0,0,0,0,0,0,-9.8,0,0,0",
    ],
)
def test_a_sample_with_an_empty_or_impossible_field_is_refused(body: str) -> None:
    with pytest.raises(ValueError, match=body.partition(",")[0]):
        read(sentence(body))


def test_a_changed_digit_is_a_checksum_failure() -> None:
    with pytest.raises(ChecksumError):
        read(imu_line(1).replace(b"9.81", b"7.81"))


def test_a_unit_turned_to_port_reads_ahead_where_the_boat_does() -> None:
    """Its x points to port: what it measures along x is to the boat's left."""
    turned = Mounting(0.0, 0.0, 90.0).turn(InertialSample((1.0, 0.0, G), (0.1, 0.0, 0.5)))
    assert turned.accel_mps2 == pytest.approx((0.0, 1.0, G))
    assert turned.gyro_radps == pytest.approx((0.0, 0.1, 0.5))


def test_the_yaw_of_a_unit_turned_to_port_is_less_than_its_own() -> None:
    attitude = euler_rad(rotation(0.0, 0.0, 0.7) @ rotation(0.0, 0.0, math.radians(30.0)))
    turned = Mounting(0.0, 0.0, 30.0).turn(InertialSample((0.0, 0.0, G), (0.0, 0.0, 0.0), attitude))
    assert turned.attitude_rad == pytest.approx((0.0, 0.0, 0.7), abs=1e-9)


def test_a_unit_upside_down_still_shows_gravity_up_and_the_boats_yaw() -> None:
    boat_yaw = 0.7
    attitude = euler_rad(rotation(0.0, 0.0, boat_yaw) @ rotation(math.pi, 0.0, 0.0))
    turned = Mounting(180.0, 0.0, 0.0).turn(InertialSample((0.2, 0.0, -G), (0.0, 0.0, -0.3), attitude))
    assert turned.accel_mps2 == pytest.approx((0.2, 0.0, G))
    assert turned.gyro_radps == pytest.approx((0.0, 0.0, 0.3))
    assert turned.attitude_rad == pytest.approx((0.0, 0.0, boat_yaw), abs=1e-9)


@given(st.floats(-3.0, 3.0), st.floats(-1.5, 1.5), st.floats(-3.0, 3.0))
def test_a_rotation_gives_its_angles_back(roll: float, pitch: float, yaw: float) -> None:
    assert euler_rad(rotation(roll, pitch, yaw)) == pytest.approx((roll, pitch, yaw), abs=1e-9)
