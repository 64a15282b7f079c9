"""The strip of time: a press shows that moment everywhere, read-only, until one press returns to the present."""

from __future__ import annotations

import asyncio
import contextlib
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from paani.config import Config
from tests.browser.conftest import Boat
from tests.browser.guidance import guiding
from tests.browser.test_page import hold_to_arm, until, wait_for_arming, watch
from tests.conftest import OpenAs, Spawn

pytestmark = [pytest.mark.browser, pytest.mark.timeout(120)]

SPEED = "document.querySelector('#speed').textContent"
SERIES = "import('/static/series.js').then(({ Series }) => { const s = new Series(4); %s })"

HISTORY_US = """fetch("/api/history").then((answer) => answer.json()).then(({ samples }) => {
  const column = (name) => samples.values[samples.names.indexOf(name)], at = column("at_us");
  return [at.at(-1), at[column("speed_mps").lastIndexOf(0.5)]];
})"""
SPAN_US = 600e6  # of the strip
AMBER, RED = "227,179,65", "255,113,118"
# The colours in the middle of a row of the strip, within the newest half minute.
NEWEST_OF_ROW = """(row) => {
  const strip = document.querySelector("#time-strip"), { width, height } = strip, newest = Math.round(width / 20);
  const y = Math.round(((row + 0.5) * height) / 4);
  const { data } = strip.getContext("2d").getImageData(width - newest, y, newest, 1);
  return Array.from({ length: data.length / 4 }, (_, i) => data.slice(4 * i, 4 * i + 3).join());
}"""


async def press_strip(page: Any, part: float) -> None:
    box = await page.locator("#time-strip").bounding_box()
    await page.mouse.click(box["x"] + part * box["width"], box["y"] + box["height"] / 2)


@pytest.mark.rotating(cpu_s=10)
async def test_a_press_shows_that_moment_everywhere(
    browser: Any, boat: Boat, open_as: OpenAs, spawn: Spawn, config: Config, tmp_path: Path
) -> None:
    async with spawn("operator"), spawn("dashboard"), guiding(open_as) as guidance:
        watched = await watch(browser, config)
        page = watched.page
        await until(page, f"{SPEED} === '0.50' && paani.overlay.mask_seq !== null")
        await until(page, "!document.querySelector('#time-back').disabled")
        begun_us, _ = await page.evaluate(HISTORY_US)
        for row, colour in ((0, AMBER), (1, RED)):
            await until(page, f"({NEWEST_OF_ROW})({row}).includes('{colour}')")  # RIGHT is advised, a STOP holds
        await page.wait_for_timeout(3000)
        assert guidance.odometry is not None
        before = boat.seq
        guidance.odometry = replace(guidance.odometry, surge_mps=1.25, x_m=40.0)
        await until(page, f"{SPEED} === '1.25'")
        await until(page, f"{HISTORY_US}.then(([newest, slow]) => newest - slow > 1.5e6)")  # what is played has an end

        # Inside the time that the page has seen at this speed, as the strip moves on before it is pressed. The newest
        # mask of a moment may be of the picture before, and is left out then.
        for share in (0.5, 0.75, 0.25):
            now_us, ended_us = await page.evaluate(HISTORY_US)
            await press_strip(page, 1.0 - (now_us - begun_us - share * (ended_us - begun_us)) / SPAN_US)
            await until(page, f"{SPEED} === '0.50'")
            await until(page, f"paani.overlay.frame_seq !== null && paani.overlay.frame_seq < {before - 2}")
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(2.0):
                    await until(page, "paani.overlay.mask_seq !== null && paani.overlay.evidence_seq !== null")
                break
        assert await page.inner_text("#past-word") == "PAST"
        assert "read-only" in await page.inner_text("#past-what")
        assert "STOP still stops the boat" in await page.inner_text("#past-live")
        await until(page, "document.querySelector('#map-pose').textContent.startsWith('5.0 m E')")
        overlay = await page.evaluate("({...paani.overlay})")
        assert len({overlay[name] for name in ("frame_seq", "picture_seq", "mask_seq", "evidence_seq")}) == 1
        assert await page.evaluate("document.querySelector('#arm').disabled && document.querySelector('#drive').hidden")
        await page.click("#map-edit")
        assert await page.evaluate("document.querySelector('#editor-send').offsetParent") is None, "nothing is sent"
        await page.click("#map-edit")
        frame = "getComputedStyle(document.body, '::after').borderTopWidth"
        assert await page.evaluate(frame) == "5px", "unmistakable"
        await page.screenshot(path=tmp_path / "past.png")

        at_us = await page.evaluate("paani.shownUs")
        await page.click("#time-next")
        assert 0 < await page.evaluate("paani.shownUs") - at_us < 2.5e6, "one step"
        await page.select_option("#time-speed", "5")
        await page.click("#time-play")
        await until(page, f"{SPEED} === '1.25'")
        await until(page, "document.querySelector('#time-play').textContent === '▶'")
        await page.click("#time-plots")
        await until(page, "document.querySelectorAll('#plots canvas').length === 6")
        await page.screenshot(path=tmp_path / "plots.png")
        await page.keyboard.press("Space")
        await wait_for_arming(boat, armed=False, stopped=True)
        await page.click("#past-live-button")
        assert await page.evaluate("paani.shownUs") is None
        await until(page, f"document.querySelector('#past').hidden && {SPEED} === '1.25'")
        await until(page, f"({NEWEST_OF_ROW})(2).includes('{RED}')")  # the STOP
        await page.click("#plots .u-over >> nth=0")
        await until(page, f"!document.querySelector('#past').hidden && paani.shownUs > {begun_us}")
        await page.click("#past-live-button")
        await until(page, "document.querySelector('#past').hidden")
        await page.click("#time-plots")
        await hold_to_arm(page)
        await wait_for_arming(boat, armed=True, stopped=False)
        assert watched.errors == []
        assert watched.foreign_requests == []


async def test_the_series_is_bounded_and_finds_moments(browser: Any, boat: Boat, spawn: Spawn, config: Config) -> None:
    async with spawn("dashboard"):
        page = (await watch(browser, config)).page
        fill = "for (const at_us of [10, 20, 20, 30, 40, 50]) s.append({ at_us, x_m: at_us, y_m: 0 });"
        ask = "return [s.columns.at_us, [9, 20, 35, 99].map((us) => s.indexAt(us)), s.trackUntil(35)]"
        got = await page.evaluate(SERIES % (fill + ask))
        assert got == [[20, 30, 40, 50], [0, 0, 1, 3], [{"x": 20, "y": 0}, {"x": 30, "y": 0}]]
        broken = await page.evaluate("import('/static/plots.js').then((p) => p.breakAtGaps([1, 2, 9], [[5, 6, 7]]))")
        assert broken == [[1, 2, 3.5, 9], [5, 6, None, 7]]
