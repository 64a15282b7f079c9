"""The tab of a hull's devices: its sensors, the bridge and the line to the thrusters, and the battery in the bar."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from paani import keys
from paani import messages as m
from paani.clock import WallClock
from paani.config import Config
from tests.at_work import at_work
from tests.browser.test_indicator_strip import SHOWS
from tests.browser.test_legibility import AXE, SERIOUS, SIDEWAYS, SMALL_TARGETS, SMALL_TEXT
from tests.browser.test_page import until, watch
from tests.browser.test_sensor_strip import GPS, HEADING, IMU
from tests.conftest import OpenAs, Spawn

pytestmark = [pytest.mark.browser, pytest.mark.timeout(120)]

THRUSTERS = m.ThrustersState(
    source_us=0, line="serial:/dev/ttyACM1@115200", connected=True, zero_cause=m.ZeroCause.NOT_ARMED,
    mcu=m.McuState.FRESH, problem="battery low", battery_v=22.14, pulse_left_us=1500, pulse_right_us=1500, sent=900,
    answered=899,
)  # fmt: skip
ROWS = """[...document.querySelectorAll("#sensor-devices tr")]
  .map((row) => [...row.children].map((cell) => cell.textContent))"""
NARROW = """[...document.querySelectorAll(".tab .facts dd")].filter((fact) => fact.clientWidth < 80)
  .map((fact) => fact.textContent)"""
OVERLAP_PX = """(() => {
  const [text, speed] = ["#advice-reason", "#speed"].map((id) => document.querySelector(id).getBoundingClientRect());
  return Math.min(text.right - speed.left, text.bottom - speed.top);
})()"""
STALE = "document.querySelector('#{}-device').classList.contains('stale')"
FACTS = "(name) => document.querySelector(`#${name}-facts`).textContent"


@pytest.fixture
def private_sets(private_sets: tuple[str, ...]) -> tuple[str, ...]:
    return (*private_sets, "profile=hull", f"bridge.line={SHOWS.line}")


@pytest.mark.rotating(cpu_s=4)
async def test_a_hulls_devices_and_its_battery(
    browser: Any, open_as: OpenAs, spawn: Spawn, config: Config, tmp_path: Path
) -> None:
    sensors = (await open_as("sensors")).publisher(keys.SENSORS_STATE)
    bridge = (await open_as("bridge")).publisher(keys.BRIDGE_STATE)
    thrusters = (await open_as("thrusters")).publisher(keys.THRUSTERS_STATE)
    is_reporting = True

    async def report() -> None:
        while True:
            now_us = WallClock().now_us()
            sensors.put(m.SensorsState(source_us=now_us, devices=(GPS, IMU, HEADING)))
            bridge.put(replace(SHOWS, source_us=now_us))
            if is_reporting:
                thrusters.put(replace(THRUSTERS, source_us=now_us))
            await asyncio.sleep(0.1)

    async with at_work(report()), spawn("dashboard"):
        watched = await watch(browser, config)
        page = watched.page
        await until(page, "document.querySelector('#battery').textContent === '22.1'")
        assert await page.inner_text("#mode") == "HULL"
        await page.click("#tab-devices")
        await until(page, f"{ROWS}.length === 3")
        rows = await page.evaluate(ROWS)
        assert rows[0] == ["gps", "ok", "serial:/dev/ttyUSB0@9600", "5.0 Hz", "2", "0", "0", "0", "GGA RMC"]
        assert rows[1][1] == "absent"
        assert rows[1][-1] == IMU.note
        for device, expected in (
            ("bridge", ("displayslight right", "boot count4", "connectedyes", f"line{SHOWS.line}")),
            ("thrusters", ("problembattery low", "battery v22.14", "zero causenot armed", "answer age msnever")),
        ):
            facts = await page.evaluate(FACTS, device)
            assert all(text in facts for text in expected), facts
        await page.evaluate(AXE.read_text(encoding="utf-8"))
        for width, height, least_px in ((1440, 900, 24), (360, 740, 44)):
            await page.set_viewport_size({"width": width, "height": height})
            await page.wait_for_timeout(300)
            await page.screenshot(path=tmp_path / f"{width}.png", full_page=True)
            assert await page.evaluate(SERIOUS) == []
            assert await page.evaluate(SMALL_TEXT) == []
            assert await page.evaluate(SMALL_TARGETS, least_px) == []
            assert await page.evaluate("document.documentElement.scrollWidth") == width
            assert await page.evaluate(SIDEWAYS) == []
            assert await page.evaluate(OVERLAP_PX) <= 0, "advice and readouts stand side by side or one above the other"
            assert await page.evaluate(NARROW) == [], "a value has the room of a word"
        is_reporting = False
        await until(page, f"{STALE.format('thrusters')} && !{STALE.format('bridge')}")
        assert watched.errors == []
