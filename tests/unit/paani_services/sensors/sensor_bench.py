"""All devices of a boat at a clock that the test moves."""

from __future__ import annotations

import random

from paani.config import GpsConfig, HeadingConfig, ImuConfig, SensorDevicesConfig
from paani.messages import GpsFix, ImuSample, SensorDevice, SensorRole
from paani_services.sensors.suite import SensorSuite
from tests.unit.paani_services.sensors.written import imu_line

GPS, IMU, HEADING = "serial:/dev/gps@9600", "serial:/dev/imu", "serial:/dev/compass@4800"
RECEIVER, SCANNER = "serial:/dev/ais@38400", "serial:/dev/lidar@230400"
SONAR = "serial:/dev/sonar@4800"
LINES = [GPS, IMU, HEADING, RECEIVER, SCANNER, SONAR]
CONFIG = SensorDevicesConfig(
    gps=GpsConfig(line=GPS), imu=ImuConfig(line=IMU), heading=HeadingConfig(line=HEADING), variation_deg=2.0
)
START_US = 1_700_000_000_000_000


class Bench:
    """The suite, and a clock that the test moves."""

    def __init__(self, config: SensorDevicesConfig = CONFIG, *, is_open: bool = True) -> None:
        self.suite, self.now_us = SensorSuite(config), START_US
        self._noise = random.Random(1)
        for address in self.suite.lines if is_open else ():
            self.suite.opened(address, self.now_us)

    def wait(self, seconds: float) -> None:
        self.now_us += round(seconds * 1e6)

    def fixes(self, data: bytes) -> tuple[GpsFix, ...]:
        return self.suite.take(GPS, data, self.now_us).fixes

    def samples(self, data: bytes) -> tuple[ImuSample, ...]:
        return self.suite.take(IMU, data, self.now_us).samples

    def noisy(self, ms: int, z: float = 9.81, rate_dps: float = 0.0) -> bytes:
        return imu_line(ms, (0.0, 0.0, z + self._noise.gauss(0.0, 0.03)), (0.0, 0.0, rate_dps))

    def run_imu(self, seconds: float, rate_dps: float = 0.0) -> list[ImuSample]:
        """100 samples a second, each in its own piece."""
        found: list[ImuSample] = []
        for _ in range(round(seconds * 100)):
            self.wait(0.01)
            found += self.samples(self.noisy(self.now_us // 1000 % 1_000_000, rate_dps=rate_dps))
        return found

    def device(self, role: SensorRole) -> SensorDevice:
        return next(device for device in self.suite.report(self.now_us) if device.role is role)
