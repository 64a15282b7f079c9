"""The strip that names each device of a real hull and what is wrong with it."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest

from paani import keys
from paani import messages as m
from paani.clock import WallClock
from paani.config import Config
from tests.at_work import at_work
from tests.browser.test_page import until, watch
from tests.conftest import OpenAs, Spawn

pytestmark = [pytest.mark.browser, pytest.mark.timeout(120)]
STRIP = "document.querySelector('#sensors')"
GPS = m.SensorDevice(
    role=m.SensorRole.GPS, line="serial:/dev/ttyUSB0@9600", status=m.SensorStatus.OK, rate_hz=5.0, heard="GGA RMC",
    checksum_failures=2,
)  # fmt: skip
IMU = m.SensorDevice(
    role=m.SensorRole.IMU,
    line="serial:/dev/ttyACM0",
    status=m.SensorStatus.ABSENT,
    note="serial:/dev/ttyACM0: vanished",
)
SHOWN = "gps ok 5.0 Hz imu absent serial:/dev/ttyACM0: vanished heading off"
HEADING = m.SensorDevice(role=m.SensorRole.HEADING, line="", status=m.SensorStatus.OFF)


@pytest.fixture
def private_sets(private_sets: tuple[str, ...]) -> tuple[str, ...]:
    return (*private_sets, "profile=hull")


@pytest.mark.rotating(cpu_s=10)
@pytest.mark.parametrize("size", [(1440, 900), (360, 740)], ids=["desk", "phone"])
async def test_each_device_is_named_with_its_status_and_what_is_wrong(
    browser: Any, open_as: OpenAs, spawn: Spawn, config: Config, size: tuple[int, int], tmp_path: Path
) -> None:
    publisher = (await open_as("sensors")).publisher(keys.SENSORS_STATE)
    is_reporting = True

    async def report() -> None:
        while True:
            if is_reporting:
                publisher.put(m.SensorsState(source_us=WallClock().now_us(), devices=(GPS, IMU, HEADING)))
            await asyncio.sleep(0.2)

    async with at_work(report()), spawn("dashboard"):
        watched = await watch(browser, config, *size)
        page = watched.page
        await until(page, f"{STRIP}.innerText.split(/\\s+/).join(' ').trim() === '{SHOWN}'")
        title = await page.evaluate(f"{STRIP}.querySelector('[data-status=ok]').title")
        assert "checksum failures 2" in title
        assert await page.evaluate("document.documentElement.scrollWidth <= innerWidth")
        await page.screenshot(path=tmp_path / "sensors.png")
        is_reporting = False
        await until(page, f"{STRIP}.textContent.includes('the sensor process is silent')")
        assert not await page.evaluate(f"{STRIP}.querySelector('[data-status=ok]')")
        assert watched.errors == []
