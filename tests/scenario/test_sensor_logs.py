"""Logs of boats, played over a pseudo-terminal through the serial adapter into the estimator, in the log's own time."""

from __future__ import annotations

import io
import math
import os
import random
from collections import Counter
from collections.abc import Callable, Iterator
from typing import NamedTuple

import pytest

from paani.config import GpsConfig, HeadingConfig, ImuConfig, LocalizationConfig, SensorDevicesConfig
from paani.geometry import enu_from_geodetic, geodetic_from_enu
from paani.messages import GpsFix, Odometry, SensorDevice, SensorRole, SensorStatus
from paani.serial_port import Port, open_port
from paani_services.localization.estimator import Estimator
from paani_services.sensors.fixes import fixes_from_sentences
from paani_services.sensors.playback import play
from paani_services.sensors.suite import SensorSuite
from tests.places import DATA
from tests.unit.paani_services.sensors.written import imu_line, sentence

LOGS = DATA / "logs"
IMU = "serial:/dev/imu"
START_US = 1_700_000_000_000_000
STEP_S = 0.05  # of the estimator: 20 Hz
ORIGIN_DEG = (48.1173, 11.5166)
TERMINAL_BYTES = 2000  # what a pseudo-terminal holds without a reader

LEAD_S = 2.0  # the inertial unit is there so much earlier than the log
# Acceleration ahead and to the left [m/s^2] and yaw rate [rad/s] at a time.
Motion = Callable[[float], tuple[float, float, float]]


class Estimate(NamedTuple):
    """One step: time since the log began, what was published, and the devices of that moment."""

    at_s: float
    odometry: Odometry
    fixes: tuple[GpsFix, ...]
    devices: dict[SensorRole, SensorDevice]


class Wire:
    """A pseudo-terminal and the port at its near end."""

    def __init__(self) -> None:
        self.far, self.near = os.openpty()
        self.address = f"serial:{os.ttyname(self.near)}"

    async def carry(self, port: Port, data: bytes) -> list[bytes]:
        """The same bytes as the port hands them out."""
        received = list[bytes]()
        for start in range(0, len(data), TERMINAL_BYTES):
            part = data[start : start + TERMINAL_BYTES]
            assert os.write(self.far, part) == len(part)
            left = len(part)
            while left:
                received.append(await port.read())
                left -= len(received[-1])
        return received


async def estimates(log: bytes, motion: Motion) -> list[Estimate]:
    """The log on a real terminal, with a simulated 6-axis unit beside it that is there 2 s before the log begins."""
    wire, noise, found = Wire(), random.Random(1), list[Estimate]()
    suite = SensorSuite(
        SensorDevicesConfig(
            gps=GpsConfig(line=wire.address), imu=ImuConfig(line=IMU), heading=HeadingConfig(line=wire.address)
        )
    )
    port, estimator, now_us = await open_port(wire.address), Estimator(LocalizationConfig()), START_US
    for address in (wire.address, IMU):
        suite.opened(address, now_us)
    pieces = timed(log)
    try:
        while pieces:
            now_us += round(STEP_S * 1e6)
            at_s = (now_us - START_US) * 1e-6 - LEAD_S
            samples = suite.take(IMU, b"".join(inertial(at_s, motion, noise)), now_us).samples
            fixes: tuple[GpsFix, ...] = ()
            while pieces and pieces[-1][0] <= at_s:
                for data in await wire.carry(port, pieces.pop()[1]):
                    fixes += suite.take(wire.address, data, now_us).fixes
            _, odometry = estimator.step(samples, fixes[-1] if fixes else None, now_us)
            found.append(Estimate(at_s, odometry, fixes, {each.role: each for each in suite.report(now_us)}))
    finally:
        await port.close()
        os.close(wire.far)
        os.close(wire.near)
    return found


def timed(log: bytes) -> list[tuple[float, bytes]]:
    """Pieces of a log and when each is due, the last first."""
    at_s, pieces = 0.0, list[tuple[float, bytes]]()
    for piece in play(io.BytesIO(log)):
        at_s += piece.wait_s
        pieces.append((at_s, piece.data))
    return pieces[::-1]


def inertial(at_s: float, motion: Motion, noise: random.Random) -> Iterator[bytes]:
    """Five lines of a unit with the noise of an MPU6050, up to a time."""
    for number in range(-4, 1):
        ahead_mps2, left_mps2, rate_radps = motion(at_s + 0.01 * number)
        accel = (ahead_mps2 + noise.gauss(0.0, 0.03), left_mps2 + noise.gauss(0.0, 0.03), 9.81 + noise.gauss(0.0, 0.03))
        rates = (noise.gauss(0.0, 0.1), noise.gauss(0.0, 0.1), math.degrees(rate_radps) + noise.gauss(0.0, 0.1))
        yield imu_line(round((at_s + LEAD_S) * 1e3) + 10 * number, accel, rates)


def at_rest(_: float) -> tuple[float, float, float]:
    return 0.0, 0.0, 0.0


# A drive whose truth is known: 10 s at rest, 4 s of acceleration to 1.2 m/s, then a circle of 40 m to port.
SPEED_MPS, RADIUS_M, SET_OFF_S, RUN_S, LENGTH_S = 1.2, 40.0, 10.0, 4.0, 150.0


def circling(at_s: float) -> tuple[float, float, float]:
    speed_mps = SPEED_MPS * min(max((at_s - SET_OFF_S) / RUN_S, 0.0), 1.0)
    rate_radps = speed_mps / RADIUS_M
    return SPEED_MPS / RUN_S if SET_OFF_S <= at_s < SET_OFF_S + RUN_S else 0.0, speed_mps * rate_radps, rate_radps


def pose(at_s: float) -> tuple[float, float, float, float]:
    """East and north [m], yaw [rad] and speed [m/s] of the drive; it sets off to the east."""
    running_s = min(max(at_s - SET_OFF_S, 0.0), RUN_S)
    way_m = 0.5 * SPEED_MPS / RUN_S * running_s**2 + SPEED_MPS * max(at_s - SET_OFF_S - RUN_S, 0.0)
    yaw_rad = way_m / RADIUS_M
    return RADIUS_M * math.sin(yaw_rad), RADIUS_M * (1.0 - math.cos(yaw_rad)), yaw_rad, SPEED_MPS * running_s / RUN_S


def drive_log(*, broken: bool) -> bytes:
    """What a receiver with two antennas writes of the drive, five times a second; every 29th sentence damaged."""
    lines = list[str]()
    for step in range(round(LENGTH_S * 5)):
        # A receiver says where it was: the latency of the settings lies between.
        x_m, y_m, yaw_rad, speed_mps = pose(0.2 * step - GpsConfig().latency_s)
        latitude_deg, longitude_deg = geodetic_from_enu(x_m, y_m, *ORIGIN_DEG)
        minutes = f"{48}{(latitude_deg - 48.0) * 60.0:08.5f},N,{11:03d}{(longitude_deg - 11.0) * 60.0:08.5f},E"
        clock = f"10{step // 300:02d}{step % 300 * 0.2:05.2f}"
        course_deg = (90.0 - math.degrees(yaw_rad)) % 360.0
        heading_deg = (90.0 - math.degrees(pose(0.2 * step)[2])) % 360.0
        lines += [
            f"GNGGA,{clock},{minutes},4,12,0.3,545.4,M,46.9,M,,",
            f"GNRMC,{clock},A,{minutes},{speed_mps * 3600.0 / 1852.0:.3f},{course_deg:.2f},230326,,,R",
            f"GNHDT,{heading_deg:.2f},T",
        ]
    text = [sentence(line) for line in lines]
    if broken:
        text[::29] = [line.replace(",", ";", 1) for line in text[::29]]
    return "".join(text).encode()


@pytest.mark.rotating(cpu_s=7)
async def test_a_drive_of_known_truth_is_estimated_from_its_log() -> None:
    """Healthy from the tenth second on, although every 29th sentence is damaged; pose and speed are right."""
    found = await estimates(drive_log(broken=True), circling)
    assert found[-1].devices[SensorRole.GPS].checksum_failures == -(-round(LENGTH_S * 5) * 3 // 29)
    believed = [each for each in found if each.at_s > 10.0]
    assert all(each.odometry.healthy for each in believed)
    for each in believed:
        x_m, y_m, yaw_rad, speed_mps = pose(each.at_s)
        estimate = each.odometry
        off_m = enu_from_geodetic(
            estimate.latitude_deg, estimate.longitude_deg, *geodetic_from_enu(x_m, y_m, *ORIGIN_DEG)
        )
        assert math.hypot(*off_m) < 0.6
        assert abs(math.remainder(estimate.yaw_rad - yaw_rad, math.tau)) < math.radians(3.0)
        assert math.hypot(estimate.surge_mps, estimate.sway_mps) == pytest.approx(speed_mps, abs=0.25)


@pytest.mark.rotating(cpu_s=10)
@pytest.mark.data
@pytest.mark.skipif(not LOGS.is_dir(), reason=f"no logs at {LOGS}; set PAANI_DATA")
async def test_a_moored_boats_log_gives_the_same_fixes_over_the_wire_and_no_frozen_receiver() -> None:
    """Four minutes: every fix arrives once, the receiver is never taken for frozen, and the boat lies still."""
    log = (LOGS / "gps_moored.nmea").read_bytes()[:68_000]
    found = await estimates(log, at_rest)
    fixes = [fix for each in found for fix in each.fixes]
    expected = list(fixes_from_sentences(log.decode().splitlines()[:-1], Counter()))
    assert [(fix.latitude_deg, fix.longitude_deg, fix.sog_mps) for fix in fixes] == [
        (fix.latitude_deg, fix.longitude_deg, fix.sog_mps) for fix in expected
    ]
    assert found[-1].devices[SensorRole.GPS].withheld == 0
    moving = [math.hypot(each.odometry.surge_mps, each.odometry.sway_mps) > 0.05 for each in found]
    assert sum(moving) < 0.05 * len(moving)  # most of it while rest is first being found


@pytest.mark.rotating(cpu_s=6)
@pytest.mark.data
@pytest.mark.skipif(not LOGS.is_dir(), reason=f"no logs at {LOGS}; set PAANI_DATA")
async def test_a_sailing_log_without_heading_and_accuracy_is_followed_and_never_believed() -> None:
    """Of a yacht's instruments, every two seconds: GLL with VTG, no HDOP, and HDT and HDM that are empty."""
    log = (LOGS / "plaka_sail.nmea").read_bytes()[:32_000]
    found = await estimates(log, at_rest)
    last = found[-1]
    assert last.at_s > 140.0
    assert last.devices[SensorRole.GPS].status is SensorStatus.OK
    assert last.devices[SensorRole.GPS].rate_hz == pytest.approx(0.5, abs=0.15)
    heading = last.devices[SensorRole.HEADING]
    assert heading.status is SensorStatus.INCOMPLETE
    assert "is empty" in heading.note
    assert not any(each.odometry.healthy for each in found)
    steps = [each for each in found if each.fixes and each.at_s > 30.0]
    assert len(steps) > 50
    for each in steps:
        fix, estimate = each.fixes[-1], each.odometry
        off_m = enu_from_geodetic(estimate.latitude_deg, estimate.longitude_deg, fix.latitude_deg, fix.longitude_deg)
        assert math.hypot(*off_m) < 20.0
