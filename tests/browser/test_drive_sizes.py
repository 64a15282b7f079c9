"""Whoever drives by hand sees picture, stick, modes, override and veto at once, on a small laptop and on a phone."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from paani import keys
from paani import messages as m
from paani.config import Config
from tests.arming import arm_on_page
from tests.browser.conftest import Boat
from tests.browser.guidance import ORDER, guiding
from tests.browser.test_drive import PAD, Orders, drive_manually
from tests.browser.test_legibility import AXE, SERIOUS, SIDEWAYS, SMALL_TARGETS, SMALL_TEXT
from tests.browser.test_page import until, watch
from tests.conftest import OpenAs, Spawn

pytestmark = [pytest.mark.browser, pytest.mark.timeout(180)]

# What one drives by that is not whole in what bar, strip of time and orders leave of the screen, or is covered.
OUT_OF_SIGHT = """(() => {
  const box = (name) => document.querySelector(name).getBoundingClientRect();
  const top = box(".bar").bottom, covers = [".orders", "#time"].map(box).filter((b) => b.top > top);
  const isSeen = (name, from, to) => {
    const b = box(name), topmost = document.elementFromPoint((b.left + b.right) / 2, (b.top + b.bottom) / 2);
    const isWhole = b.height > 0 && b.top >= from && b.bottom <= to && b.left >= 0 && b.right <= innerWidth;
    return isWhole && topmost?.closest(name);
  };
  const bottom = Math.min(innerHeight, ...covers.map((b) => b.top));
  const found = ["#camera", "#stick", "#drive-modes", "#drive-asks", "#drive-override", "#drive-note"];
  return [...found.filter((name) => !isSeen(name, top, bottom)), ...(isSeen("#stop", 0, innerHeight) ? [] : ["#stop"])];
})()"""
# Why modes may not start, as it stands in view: in each, or where there is no room beside the stick.
BARRED = """(() => {
  const isSeen = (e) => {
    const b = e.getBoundingClientRect();
    return b.height > 0 && e.contains(document.elementFromPoint((b.left + b.right) / 2, (b.top + b.bottom) / 2));
  };
  const barred = [...document.querySelectorAll("[data-drive]:disabled")].filter((e) => isSeen(e.querySelector("span")));
  const others = document.querySelector("#drive-bars"), words = isSeen(others) ? others.textContent.split(" · ") : [];
  return [...barred.map((e) => [...e.children].map((each) => each.textContent).join(": ")), ...words];
})()"""
PICTURE_PX = "document.querySelector('#camera').clientWidth"
SIZES = ((1440, 900, 400), (1024, 768, 360), (360, 740, 340), (740, 360, 320), (844, 390, 360), (360, 640, 240))


@pytest.fixture
async def driven(
    browser: Any, boat: Boat, open_as: OpenAs, spawn: Spawn, config: Config
) -> AsyncIterator[tuple[Any, Orders]]:
    """A page of an armed boat whose advice vetoes thrust ahead, and what is ordered."""
    orders = Orders((await open_as("observer")).latest(keys.OPERATOR_ORDER))
    async with spawn("operator"), spawn("dashboard"), guiding(open_as) as guidance:
        guidance.order = replace(ORDER, leg="manual", speed_mps=0.0, vetoes=(m.Inhibit.BLOCKED_AHEAD,))
        watched = await watch(browser, config)
        await until(watched.page, "paani.overlay.mask_seq !== null")
        await arm_on_page(f"http://127.0.0.1:{config.dashboard.port}", config.bus)
        yield watched.page, orders
        assert watched.errors == []


async def until_in_sight(page: Any, orders: Orders, size: tuple[int, int]) -> None:
    """A page that a busy machine kept silent for too long takes MANUAL again."""
    hidden: list[str] = []
    try:
        async with asyncio.timeout(10.0):
            while hidden := await page.evaluate(OUT_OF_SIGHT):
                if await page.get_attribute("#drive", "data-driving") == "false":
                    await drive_manually(page, orders)
                await asyncio.sleep(0.2)
    except TimeoutError:
        pytest.fail(f"{size}: {hidden}")


@pytest.mark.rotating(cpu_s=10)
async def test_a_gamepad_drives_by_what_is_in_view_on_every_screen(driven: tuple[Any, Orders], tmp_path: Path) -> None:
    page, orders = driven
    for width, height, least_px in SIZES:
        await page.set_viewport_size({"width": width, "height": height})
        await drive_manually(page, orders)
        await page.evaluate(PAD, [0.0, 0.0])
        await page.wait_for_timeout(300)
        await page.evaluate(PAD, [0.0, -0.5])
        await orders.until(lambda found: found.stick == (0.5, 0.0))
        await until(page, "document.querySelector('#drive-note').textContent.startsWith('The advice')")
        await page.wait_for_timeout(500)
        await page.screenshot(path=tmp_path / f"{width}.png")
        await until_in_sight(page, orders, (width, height))
        assert await page.evaluate(BARRED) == ["Return: home not known yet"], (width, height)
        assert await page.evaluate(PICTURE_PX) >= least_px, (width, height)
        assert await page.evaluate(SIDEWAYS) == [], (width, height)
        await page.evaluate(PAD, None)
        await page.click("[data-drive=IDLE]")
        await until(page, "document.querySelector('#drive').dataset.driving === 'false'")


@pytest.mark.rotating(cpu_s=7)
async def test_a_phone_that_is_turned_keeps_picture_and_stick_in_view(
    driven: tuple[Any, Orders], tmp_path: Path
) -> None:
    page, orders = driven
    await page.set_viewport_size({"width": 360, "height": 740})
    await drive_manually(page, orders)
    await page.evaluate(AXE.read_text(encoding="utf-8"))
    await until(page, "document.querySelector('#drive-note').textContent.startsWith('The advice')")
    for width, height in ((740, 360), (360, 740)):
        await page.evaluate("scrollTo(0, 400)")
        await page.wait_for_timeout(300)
        assert await page.evaluate(OUT_OF_SIGHT), "whoever looks at the map scrolls"
        await page.set_viewport_size({"width": width, "height": height})
        await until_in_sight(page, orders, (width, height))
        box = await page.locator("#stick").bounding_box()
        middle = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        await page.mouse.move(*middle)
        await page.mouse.down()
        await page.mouse.move(middle[0] - box["width"] / 4, middle[1] - box["height"] / 4)
        await orders.until(lambda found: found.stick == (0.5, 0.5))
        await page.screenshot(path=tmp_path / f"turned-{width}.png")
        await page.mouse.up()
        assert await page.evaluate(SMALL_TARGETS, 44) == [], (width, height)
        assert await page.evaluate(SMALL_TEXT) == [], (width, height)
        assert await page.evaluate(SERIOUS) == [], (width, height)
    await page.click("[data-drive=IDLE]")
    await until(page, "document.querySelector('#drive').dataset.driving === 'false'")
    assert await page.is_visible(".panel.camera header"), "at rest the panels are as they were"
