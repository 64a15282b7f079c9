"""The page says whether the drive is being recorded."""

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
from tests.browser.conftest import Boat
from tests.browser.test_page import until, watch
from tests.conftest import OpenAs, Spawn

pytestmark = [pytest.mark.browser, pytest.mark.timeout(120)]
CLOCK = WallClock()
CHIP = "document.querySelector('#record')"


def state(**changes: Any) -> m.RecorderState:
    now_us = CLOCK.now_us()
    fields: dict[str, Any] = {"recording": True, "file": "20250101T000000Z-1.mcap", "written": 5000}
    return m.RecorderState(source_us=now_us, since_us=now_us - 720_000_000, **(fields | changes))


@pytest.mark.rotating(cpu_s=4)
async def test_the_page_says_whether_it_records(
    browser: Any, boat: Boat, open_as: OpenAs, spawn: Spawn, config: Config, tmp_path: Path
) -> None:
    """P3: drops are shown; a dead recorder is said."""
    publisher = (await open_as("recorder")).publisher(keys.RECORDER_STATE)
    changes: dict[str, Any] = {}

    async def speak() -> None:
        while True:
            publisher.put(state(**changes))
            await asyncio.sleep(0.2)

    async with spawn("dashboard", f"recorder.folder={tmp_path}"):
        page = (await watch(browser, config)).page
        await until(page, f"{CHIP}.dataset.record === 'off' && !{CHIP}.hidden")
        assert await page.inner_text("#record") == "not recording"
        async with at_work(speak()):
            await until(page, f"{CHIP}.dataset.record === 'on'")
            assert "REC 12 min" in await page.inner_text("#record")
            await page.screenshot(path=tmp_path / "on.png")
            changes = {"dropped": 3}
            await until(page, f"{CHIP}.dataset.record === 'loses'")
            assert "3 dropped" in await page.inner_text("#record")
            assert await page.evaluate("document.documentElement.scrollWidth <= innerWidth")
            changes = {"recording": False, "problem": "312 MiB left on the disk (recorder.min_free_mib)"}
            await until(page, f"{CHIP}.dataset.record === 'off'")
            assert "312 MiB left" in await page.evaluate(f"{CHIP}.title")
            changes = {}
            await until(page, f"{CHIP}.dataset.record === 'on'")
        await until(page, f"{CHIP}.dataset.record === 'off'")
        await page.screenshot(path=tmp_path / "off.png")
        assert await page.evaluate(f"{CHIP}.title") == "the recorder is silent"
        await page.set_viewport_size({"width": 360, "height": 740})
        assert await page.evaluate("document.documentElement.scrollWidth") == 360


async def test_the_chip_is_hidden_where_nothing_is_to_be_recorded(
    browser: Any, boat: Boat, spawn: Spawn, config: Config
) -> None:
    async with spawn("dashboard"):
        page = (await watch(browser, config)).page
        await until(page, "paani.overlay.mask_seq !== null")
        assert await page.evaluate(f"{CHIP}.hidden")
        await until(page, "document.querySelector('#health').textContent.includes('camera')")
        assert "recorder" not in await page.text_content("#health")
