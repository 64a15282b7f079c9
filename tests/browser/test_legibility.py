"""The page on a desk, a small laptop and a phone, by day, at dusk and at night: legible, reachable, nothing serious."""

from __future__ import annotations

import asyncio
import hashlib
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from paani import messages as m
from paani.config import Config
from tests.browser.conftest import Boat
from tests.browser.guidance import ORDER, guiding
from tests.browser.test_page import Watched, until, watch
from tests.browser.test_time import press_strip
from tests.conftest import OpenAs, Spawn
from tests.unit.paani.logs.small_logs import NAME, finished

pytestmark = [pytest.mark.browser, pytest.mark.timeout(300)]

AXE = Path(__file__).parent / "axe" / "axe.min.js"
SERIOUS = """axe.run(document, { resultTypes: ["violations"] }).then((found) => found.violations
  .filter((rule) => rule.impact === "serious" || rule.impact === "critical")
  .flatMap((rule) => rule.nodes.map((node) => `${rule.id}: ${node.target} ${node.any[0]?.message ?? ""}`)))"""
FAINT = SERIOUS.replace("{ resultTypes", '{ runOnly: ["color-contrast"], resultTypes')
SMALL_TEXT = """[...document.querySelectorAll("body *")].filter((e) => e.offsetParent &&
  [...e.childNodes].some((child) => child.nodeType === 3 && child.textContent.trim()) &&
  parseFloat(getComputedStyle(e).fontSize) < 12).map((e) => e.outerHTML.slice(0, 80))"""
SMALL_TARGETS = """(least) => [...document.querySelectorAll("button")].filter((e) => e.offsetParent)
  .filter((e) => Math.min(e.getBoundingClientRect().width, e.getBoundingClientRect().height) < least)
  .map((e) => e.outerHTML.slice(0, 80))"""
TABS = "[...document.querySelectorAll('[data-tab-of]')].filter((e) => !e.hidden).map((e) => e.dataset.tabOf)"
CUT_OFF = """[...document.querySelectorAll(".tab .panel, .tab .scroll")].filter((e) => e.offsetParent)
  .filter((e) => e.scrollWidth > e.clientWidth).map((e) => `${e.scrollWidth} px: ${e.innerText.slice(0, 40)}`)"""
SIDEWAYS = """[document.documentElement, ...document.querySelectorAll("body *")]
  .filter((e) => e === document.documentElement || e.offsetParent)
  .filter((e) => e.matches("html, .panel, .tabs, .bar") || ["auto", "scroll"].includes(getComputedStyle(e).overflowX))
  .filter((e) => e.scrollWidth > e.clientWidth)
  .map((e) => `${e.scrollWidth} of ${e.clientWidth} px: ${e.outerHTML.slice(0, 80)}`)"""
BOX = "(name) => { const b = document.querySelector(name).getBoundingClientRect(); return [b.top, b.bottom]; }"
PALETTES = 4  # with the one that the system chooses
LAPTOP_PX = 1024  # laid out as a desk is, so what axe finds on one it finds on the other
VIEWS = [("day", 1440, 900, 24), ("dusk", 360, 740, 44), ("night", LAPTOP_PX, 768, 24)]
STANDING = replace(
    ORDER, enable=False, speed_mps=0.0, inhibits=(m.Inhibit.NOT_ARMED, m.Inhibit.NO_FREE_PATH, m.Inhibit.OUTSIDE_FENCE)
)


def test_axe_is_the_one_that_its_readme_names() -> None:
    assert hashlib.sha256(AXE.read_bytes()).hexdigest() in AXE.with_name("README.md").read_text(encoding="utf-8")


async def faint_in_other_palettes(page: Any, palette: str) -> list[str]:
    """What axe finds too faint in the palettes that this size was not looked at in; of colours nothing else depends."""
    found = []
    for tab in (await page.evaluate(TABS))[::-1]:
        await page.evaluate("(name) => document.querySelector(`[data-tab-of=${name}]`).click()", tab)
        looked_at = {palette}
        for _ in range(PALETTES):
            await page.keyboard.press("d")
            current = await page.evaluate("document.documentElement.dataset.palette")
            if current not in looked_at:  # the one that the system chooses is one of the others
                looked_at.add(current)
                found += [f"{current}, {tab}: {one}" for one in await page.evaluate(FAINT)]
    return found


@pytest.mark.rotating(cpu_s=20)
async def test_every_palette_and_size_is_legible(
    browser: Any, boat: Boat, open_as: OpenAs, spawn: Spawn, config: Config
) -> None:
    axe = AXE.read_text(encoding="utf-8")
    origin = f"http://127.0.0.1:{config.dashboard.port}"
    async with spawn("operator"), spawn("dashboard"), guiding(open_as) as guidance:
        guidance.order = STANDING
        page = await browser.new_page(color_scheme="dark")
        watched = Watched(page, origin)
        await page.goto(origin)
        await until(page, "document.querySelector('#activity-word').textContent === 'STOPPED'")
        await until(page, "paani.overlay.mask_seq !== null")
        await page.evaluate(axe)
        for palette, width, height, least_px in VIEWS:
            await page.set_viewport_size({"width": width, "height": height})
            while await page.evaluate("document.documentElement.dataset.palette") != palette or (
                await page.inner_text("#palette-name") == "Auto"
            ):
                await page.keyboard.press("d")
            await page.wait_for_timeout(300)
            for tab in (await page.evaluate(TABS))[::-1]:  # the one people drive from comes last
                await page.evaluate("(name) => document.querySelector(`[data-tab-of=${name}]`).click()", tab)
                await page.wait_for_timeout(700)
                if width != LAPTOP_PX:
                    assert await page.evaluate(SERIOUS) == [], (palette, tab)
                assert await page.evaluate(SMALL_TEXT) == [], (palette, tab)
                assert await page.evaluate(SMALL_TARGETS, least_px) == [], (palette, tab)
                assert await page.evaluate("document.documentElement.scrollWidth") == width, (palette, tab)
                assert await page.evaluate(CUT_OFF) == [], (palette, tab)
            if width != LAPTOP_PX:
                assert await faint_in_other_palettes(page, palette) == []
            top, bottom = await page.evaluate(BOX, ".panel.map")
            assert bottom <= height or (width < 400 and top < 540), f"{palette}: the map needs scrolling"
        await page.evaluate("scrollTo(0, document.body.scrollHeight)")
        assert (await page.evaluate(BOX, ".bar"))[0] == 0, "the bar stays"
        await page.reload()
        assert await page.evaluate("document.documentElement.dataset.palette") == "night"
        assert watched.errors == []


async def serious_in_every_palette(page: Any) -> list[str]:
    """What axe finds on what is open now."""
    await page.evaluate(AXE.read_text(encoding="utf-8"))
    found, looked_at = [], set[str]()
    for _ in range(PALETTES):
        await page.keyboard.press("d")
        current = await page.evaluate("document.documentElement.dataset.palette")
        if current in looked_at:
            continue
        looked_at.add(current)
        await page.wait_for_timeout(300)
        found += [f"{current}: {one}" for one in await page.evaluate(SERIOUS)]
    return found


@pytest.mark.rotating(cpu_s=6)
async def test_recordings_and_the_past_are_legible_in_every_palette(
    browser: Any, boat: Boat, spawn: Spawn, config: Config, tmp_path: Path
) -> None:
    await asyncio.to_thread(finished, tmp_path, 200, 20)
    async with spawn("dashboard", f"recorder.folder={tmp_path}"):
        page = (await watch(browser, config)).page
        await until(page, "paani.overlay.mask_seq !== null")
        await page.click("[data-tab-of='recordings']")
        await until(page, "document.querySelectorAll('#recordings tr').length === 1")
        assert await serious_in_every_palette(page) == []
        await page.click(f'#recordings [data-name="{NAME}"] button:has-text("Replay here")')
        await until(page, "document.querySelector('#past-word').textContent === 'RECORDING'")
        assert await serious_in_every_palette(page) == []
        await page.keyboard.press("l")
        await until(page, "paani.shownUs === null")
        await press_strip(page, 0.99)
        await until(page, "document.querySelector('#past-word').textContent === 'PAST'")
        assert await serious_in_every_palette(page) == []


@pytest.mark.rotating(cpu_s=4)
async def test_a_replay_is_legible_in_every_palette(browser: Any, spawn: Spawn, config: Config, tmp_path: Path) -> None:
    recording = await asyncio.to_thread(finished, tmp_path, 200, 20)
    async with spawn("dashboard", f"dashboard.replayed={recording}"):
        page = (await watch(browser, config)).page
        await until(page, "document.querySelector('#mode').textContent === 'REPLAY' && paani.shownUs !== null")
        await until(page, "document.querySelector('#past-what').textContent.endsWith('read-only')")
        assert await serious_in_every_palette(page) == []
