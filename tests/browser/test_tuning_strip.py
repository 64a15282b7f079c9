"""The strip that says which parameters are in force and what is tried beside them."""

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
LOWER = m.Change(path="advisor.policy.center_block_risk", value="0.46")
WEIGHT = m.Change(path="advisor.risk.non_water", value="0.5")
FOUND = m.Disagreement(
    source_us=1, frame_seq=3, frame_epoch=1, active_direction=m.Direction.STOP, active_reason=m.Reason.NO_SAFE_SIDE,
    shadow_direction=m.Direction.SLIGHT_LEFT, shadow_reason=m.Reason.CENTER_EDGE_INCURSION,
)  # fmt: skip
TRIED = m.Shadow(
    source_us=0, proposal="7f3a", changes=(LOWER,), frames=120, frames_needed=50, differing=3, differing_frac=0.025,
    moves_more=2, stops_more=1, recent=(FOUND,),
)  # fmt: skip
SHOWN = "!document.querySelector('#tuning').hidden"


@pytest.mark.rotating(cpu_s=4)
async def test_the_strip_shows_parameters_in_force_and_on_trial(
    browser: Any, boat: Boat, open_as: OpenAs, spawn: Spawn, config: Config, tmp_path: Path
) -> None:
    publisher = (await open_as("advisor")).publisher(keys.SHADOW)
    report = m.Shadow(source_us=0)

    async def speak() -> None:
        while True:
            publisher.put(msgspec.structs.replace(report, source_us=WallClock().now_us()))
            await asyncio.sleep(0.1)

    async with at_work(speak()), spawn("dashboard"):
        watched = await watch(browser, config)
        page = watched.page
        await until(page, "paani.overlay.mask_seq !== null")
        assert not await page.evaluate(SHOWN)
        assert await page.evaluate("document.documentElement.scrollHeight <= innerHeight")

        report = TRIED
        await until(page, SHOWN)
        text = await page.inner_text("#tuning")
        assert "7f3a tried: policy.center_block_risk = 0.46" in text
        assert "3 of 120 frames differ (2.5 %), would move on 2 where it stops, stop on 1 where it moves" in text
        assert "last: STOP (no safe side), tried: SLIGHT LEFT (something reaches into the centre)" in text
        assert await page.evaluate("document.querySelector('#tuning-counts').dataset.moves") == "true"
        assert await page.evaluate("document.documentElement.scrollWidth <= innerWidth")
        assert await page.evaluate("document.documentElement.scrollHeight <= innerHeight")
        await page.screenshot(path=tmp_path / "tuning.png")

        await page.click("[data-tab-of='settings']")
        trial = "document.querySelector('#settings-trial').textContent"
        await until(page, f"{trial}.startsWith('7f3a tried beside') && {trial}.includes('3 of 120 frames differ')")
        await until(page, "document.querySelectorAll('#settings tr').length > 200")
        assert not await page.evaluate("document.querySelector('#settings-promote').disabled")
        visible = "[...document.querySelectorAll('#settings tr')].filter((row) => row.offsetParent)"
        await page.fill("#settings-search", "center_block_risk")
        await until(page, f"{visible}.length === 1")
        texts = f"[...{visible}[0].children].map((cell) => cell.textContent)"
        assert (await page.evaluate(texts))[:6] == [
            "advisor.policy.center_block_risk", "0.48", "–", "0.48", "0 to 1", "default",
        ]  # fmt: skip
        assert await page.locator("#settings input:visible").count() == 1, "it can be tried"
        await page.screenshot(path=tmp_path / "settings.png")

        weights = "[...document.querySelectorAll('.lane .parts span')].map((part) => part.title.split(' ')[0])"
        assert (await page.evaluate(weights))[:4] == ["0.55", "0.65", "0.2", "0.15"]
        report = m.Shadow(source_us=0, active="7f3a", active_changes=(LOWER, WEIGHT), previous=True)
        await until(page, f"({texts})[1] === '0.46' && ({texts})[5] === 'tuned'")
        await page.click("[data-tab-of='drive']")
        await until(page, "document.querySelector('#tuning-force').dataset.promoted === 'true'")
        assert "7f3a in force: policy.center_block_risk = 0.46, risk.non_water = 0.5" in await page.inner_text(
            "#tuning"
        )
        await until(page, f"({weights})[0] === '0.5'")
        log = "document.querySelector('#log').textContent"
        await until(page, f"{log}.includes('in force: 7f3a')")

        report = m.Shadow(source_us=0)
        publisher.new_epoch()
        await until(page, f"!({SHOWN}) && {log}.includes('the advisor restarted: back at its configuration')")
        assert watched.errors == []


@pytest.mark.rotating(cpu_s=3)
async def test_the_strip_fits_a_phone(browser: Any, boat: Boat, open_as: OpenAs, spawn: Spawn, config: Config) -> None:
    publisher = (await open_as("advisor")).publisher(keys.SHADOW)
    async with spawn("dashboard"):
        page = (await watch(browser, config, 360, 740)).page
        await until(page, "paani.overlay.mask_seq !== null")
        publisher.put(msgspec.structs.replace(TRIED, source_us=WallClock().now_us()))
        await until(page, SHOWN)
        assert await page.evaluate("document.documentElement.scrollWidth") == 360
