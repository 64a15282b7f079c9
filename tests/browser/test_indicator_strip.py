"""The strip that says what the microcontroller shows."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import msgspec
import pytest

from paani import keys
from paani import messages as m
from paani.clock import WallClock
from paani.config import Config
from tests.at_work import at_work
from tests.browser.conftest import Boat
from tests.browser.test_page import until, watch
from tests.conftest import OpenAs, Spawn

pytestmark = [pytest.mark.browser, pytest.mark.timeout(120)]
LINE = "serial:/dev/ttyACM0@115200"
STRIP = "document.querySelector('#indicator')"
SHOWS = m.BridgeState(
    source_us=0, line=LINE, connected=True, direction=m.Direction.SLIGHT_RIGHT, display=m.Direction.SLIGHT_RIGHT,
    mcu=m.McuState.FRESH, sent=1000, answered=998, round_trip_p50_ms=3.21, round_trip_p95_ms=6.5, boot_count=4,
    reset_cause=m.ResetCause.WATCHDOG, refused_crc=2,
)  # fmt: skip
GONE = m.BridgeState(
    source_us=0, line=LINE, connected=False, problem=f"{LINE}: vanished", direction=m.Direction.SLIGHT_RIGHT
)


def shows(word: str, facts: str) -> str:
    """Whether the strip says so, as JavaScript."""
    text = "document.querySelector('#indicator-{}').textContent === '{}'"
    return f"{text.format('word', word)} && {text.format('facts', facts)}"


@pytest.mark.rotating(cpu_s=4)
async def test_the_strip_shows_what_the_microcontroller_shows(
    browser: Any, boat: Boat, open_as: OpenAs, spawn: Spawn, config: Config, tmp_path: Path
) -> None:
    publisher = (await open_as("bridge")).publisher(keys.BRIDGE_STATE)
    state: m.BridgeState | None = SHOWS

    async def report() -> None:
        while True:
            if state is not None:
                publisher.put(msgspec.structs.replace(state, source_us=WallClock().now_us()))
            await asyncio.sleep(0.1)

    async with at_work(report()), spawn("dashboard", f"bridge.line={LINE}"):
        watched = await watch(browser, config)
        page = watched.page
        # All at once: on a busy machine the next report may be late, and the strip says so meanwhile.
        await until(page, f"{STRIP}.dataset.kind === 'turn' && {shows('SLIGHT RIGHT', 'fresh · 3.2 ms · boot 4')}")
        title = await page.evaluate(f"{STRIP}.title")
        assert title == f"{LINE}: 998 of 1000 frames answered, p95 6.5 ms, refused: crc 2; last reset: watchdog"
        assert await page.evaluate("document.documentElement.scrollWidth <= innerWidth")
        assert await page.evaluate("document.documentElement.scrollHeight <= innerHeight")
        await page.screenshot(path=tmp_path / "indicator.png")

        state = GONE
        await until(page, f"{STRIP}.dataset.problem === 'true' && {shows('UNKNOWN', f'{LINE}: vanished')}")
        await page.screenshot(path=tmp_path / "vanished.png")

        state = None
        await until(page, "document.querySelector('#indicator-facts').textContent === 'the bridge is silent'")
        assert watched.errors == []


@pytest.mark.rotating(cpu_s=4)
async def test_without_a_bridge_and_devices_there_is_no_strip(
    browser: Any, boat: Boat, open_as: OpenAs, spawn: Spawn, config: Config
) -> None:
    async with spawn("dashboard"):
        page = (await watch(browser, config)).page
        await until(page, "paani.overlay.mask_seq !== null")
        assert await page.evaluate(f"{STRIP}.hidden")
        assert await page.evaluate("document.querySelector('#sensors').hidden")


@pytest.mark.rotating(cpu_s=4)
async def test_the_strip_fits_a_phone(browser: Any, boat: Boat, open_as: OpenAs, spawn: Spawn, config: Config) -> None:
    publisher = (await open_as("bridge")).publisher(keys.BRIDGE_STATE)
    async with spawn("dashboard", f"bridge.line={LINE}"):
        page = (await watch(browser, config, 360, 740)).page
        await until(page, "paani.overlay.mask_seq !== null")
        publisher.put(msgspec.structs.replace(GONE, source_us=WallClock().now_us()))
        await until(page, f"{STRIP}.dataset.problem === 'true'")
        assert await page.evaluate("document.documentElement.scrollWidth") == 360
