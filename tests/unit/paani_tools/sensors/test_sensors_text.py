"""Devices as lines of text."""

from __future__ import annotations

import math

import msgspec
import pytest

from paani.cli import main
from paani.messages import GpsFix, ImuSample, SensorDevice, SensorRole, SensorStatus
from paani_tools.sensors.text import device_line, missing

FIX = GpsFix(
    source_us=1, latitude_deg=48.1, longitude_deg=11.5, sog_mps=1.25, cog_rad=math.radians(45.0), position_std_m=2.4
)
SAMPLE = ImuSample(
    source_us=1, gyro_x_radps=0, gyro_y_radps=0, gyro_z_radps=0.1, accel_x_mps2=0, accel_y_mps2=3.0, accel_z_mps2=9.0
)
HEADED = msgspec.structs.replace(SAMPLE, orientation_available=True, yaw_rad=0.0)


def device(role: SensorRole, status: SensorStatus = SensorStatus.OK, **changes: object) -> SensorDevice:
    row = SensorDevice(role=role, line="file:a", status=status, rate_hz=5.0, age_s=0.2)
    return msgspec.structs.replace(row, **changes)


def test_a_device_in_order_says_what_it_measures_in_one_line() -> None:
    text = device_line(device(SensorRole.GPS, heard="RMC GGA"), FIX, None)
    assert text == (
        "gps     ok            48.100000 11.500000 +-2.4 m, 1.25 m/s to 45 deg  5.0 Hz  0.2 s ago  [file:a: RMC GGA]"
    )
    assert "9.49 m/s^2, turning 5.7 deg/s to port" in device_line(device(SensorRole.IMU), None, SAMPLE)
    assert "heading 90.0 deg true" in device_line(device(SensorRole.HEADING), None, HEADED)


def test_a_device_that_is_not_in_order_says_why_and_no_old_value() -> None:
    row = device(SensorRole.GPS, SensorStatus.ABSENT, note="vanished", checksum_failures=3, age_s=1e6, rate_hz=0.0)
    text = device_line(row, FIX, None)
    assert "48.1" not in text
    assert "absent" in text
    assert "checksum 3  vanished" in text
    assert "never" in text
    assert (
        device_line(device(SensorRole.IMU, SensorStatus.OFF), None, SAMPLE)
        == "imu     off         sensors.imu.line is not set"
    )


def test_what_the_boat_lacks_is_named() -> None:
    gps, imu = device(SensorRole.GPS), device(SensorRole.IMU)
    off = device(SensorRole.HEADING, SensorStatus.OFF)
    assert missing((gps, imu, off), HEADED) == ""
    assert "heading" in missing((gps, imu, off), SAMPLE)
    assert "heading" in missing((gps, imu, off), None)
    frozen = device(SensorRole.GPS, SensorStatus.FROZEN)
    assert missing((frozen, device(SensorRole.IMU, SensorStatus.OFF), off), None) == "missing: gps (frozen), imu (off)"


@pytest.mark.parametrize(
    ("words", "named"),
    [(["--for", "0"], "--for"), (["--for", "nan"], "--for"), (["--profile", "paani"], "profile 'paani'")],
)
def test_a_mistake_is_one_line(words: list[str], named: str, capsys: pytest.CaptureFixture[str]) -> None:
    try:
        code = main(["sensors", *words])
    except SystemExit as left:
        code = left.code  # type: ignore[assignment]  # argparse gives a number
    assert code == 2
    assert named in capsys.readouterr().err.splitlines()[-1]
