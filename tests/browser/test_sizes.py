"""From a phone to a wall: nothing scrolls sideways on 360 px, and all that is written grows with a large screen."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from paani import keys
from paani import messages as m
from paani.clock import WallClock
from paani.config import Config
from tests.at_work import at_work
from tests.browser.conftest import Boat
from tests.browser.guidance import guiding
from tests.browser.test_indicator_strip import SHOWS
from tests.browser.test_legibility import SIDEWAYS, TABS
from tests.browser.test_map_objects import MISSION
from tests.browser.test_page import until, watch
from tests.conftest import OpenAs, Spawn
from tests.unit.paani.logs.small_logs import finished

pytestmark = [pytest.mark.browser, pytest.mark.timeout(180)]

ROWS = "(name) => document.querySelectorAll(`[data-tab-panel=${name}] :is(tbody tr, dd)`).length"
LEAST_TEXT_PX = """Math.min(...[...document.querySelectorAll("body *")].filter((e) => e.offsetParent &&
  [...e.childNodes].some((child) => child.nodeType === 3 && child.textContent.trim()))
  .map((e) => parseFloat(getComputedStyle(e).fontSize)))"""
MAP_SCALE = """(() => {
  const ctx = document.querySelector("#map").getContext("2d");
  return ctx.getTransform().a * parseFloat(ctx.font);
})()"""


@pytest.fixture
async def talkative(open_as: OpenAs, private_sets: tuple[str, ...]) -> AsyncIterator[None]:
    """A bridge and a recorder that say much of themselves."""
    bridge = (await open_as("bridge")).publisher(keys.BRIDGE_STATE)
    recorder = (await open_as("recorder")).publisher(keys.health("recorder"))

    async def report() -> None:
        while True:
            now_us = WallClock().now_us()
            bridge.put(replace(SHOWS, source_us=now_us))
            recorder.put(
                m.Health(
                    source_us=now_us, service="recorder", ready=True, uptime_s=9.0, cpu_cores=1.25, rss_mib=1061.4,
                    open_files=1023, temperature_c=48.6, note="20250101T000000Z-1.mcap: 123456789 written, 0 dropped",
                    drops=(m.DropCount(cause="thrust_stale_echo", count=31234), m.DropCount(cause="imu_late", count=9)),
                )
            )  # fmt: skip
            await asyncio.sleep(0.2)

    async with at_work(report()):
        yield


@pytest.fixture
def private_sets(private_sets: tuple[str, ...], tmp_path: Path) -> tuple[str, ...]:
    return (*private_sets, f"bridge.line={SHOWS.line}", f"recorder.folder={tmp_path}")


async def show(page: Any, tab: str) -> None:
    await page.evaluate("(name) => document.querySelector(`[data-tab-of=${name}]`).click()", tab)
    if tab != "drive":
        async with asyncio.timeout(10.0):
            while not await page.evaluate(ROWS, tab):
                await asyncio.sleep(0.1)
    await page.wait_for_timeout(700)


@pytest.mark.rotating(cpu_s=10)
async def test_no_tab_scrolls_sideways_on_a_phone(
    browser: Any, boat: Boat, talkative: None, open_as: OpenAs, spawn: Spawn, config: Config, tmp_path: Path
) -> None:
    await asyncio.to_thread(finished, tmp_path, 200, 20)
    async with spawn("operator"), spawn("dashboard"), guiding(open_as):
        page = (await watch(browser, config, 360, 740)).page
        await until(page, "paani.overlay.mask_seq !== null")
        await until(page, "!document.querySelector('#tab-devices').hidden")
        tabs = await page.evaluate(TABS)
        assert len(tabs) == 6
        for tab in tabs:
            await show(page, tab)
            if tab == "health":
                await until(page, "document.querySelector('#health').textContent.includes('thrust stale echo 31234')")
                await page.click("#health button:text-is('dashboard')")
            if tab == "topics":
                await page.click("#topics button:text-is('advisor/advisory')")
            await page.screenshot(path=tmp_path / f"{tab}.png", full_page=True)
            assert await page.evaluate(SIDEWAYS) == [], tab
        assert await page.evaluate(
            "[...document.querySelectorAll('#health td')].every((cell) => cell.scrollWidth <= cell.clientWidth)"
        )


@pytest.mark.rotating(cpu_s=10)
async def test_what_is_written_grows_with_a_large_screen(
    browser: Any, boat: Boat, talkative: None, open_as: OpenAs, spawn: Spawn, config: Config, tmp_path: Path
) -> None:
    async with spawn("operator"), spawn("dashboard"), guiding(open_as) as guidance:
        mission = guidance.navigator.publisher(keys.MISSION)
        page = (await watch(browser, config, 1440, 900)).page
        await until(page, "paani.overlay.mask_seq !== null")
        mission.put(replace(MISSION, source_us=WallClock().now_us()))
        for width, height, least_px in ((1440, 900, 12), (2560, 1440, 12), (3840, 2160, 18)):
            await page.set_viewport_size({"width": width, "height": height})
            for tab in (await page.evaluate(TABS))[::-1]:
                await page.evaluate("(name) => document.querySelector(`[data-tab-of=${name}]`).click()", tab)
                await page.wait_for_timeout(700)
                assert await page.evaluate(LEAST_TEXT_PX) == least_px, (width, tab)
                assert await page.evaluate("document.documentElement.scrollWidth") == width, tab
            assert await page.evaluate(MAP_SCALE) == least_px, "on the map too"
            await page.click("#time-plots")
            await page.wait_for_timeout(500)
            await page.screenshot(path=tmp_path / f"{width}.png")
            plot_px = await page.evaluate("document.querySelector('.plots .u-wrap').offsetHeight")
            assert plot_px == 11 * least_px, "and in the plots"
            await page.click("#time-plots")
