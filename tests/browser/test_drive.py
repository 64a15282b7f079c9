"""Driving from the page: modes with the reason why not, a dead man's handle, and the wheel taken over."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from paani import keys
from paani import messages as m
from paani.bus import Latest
from paani.clock import WallClock
from paani.config import Config
from paani.messages import DriveMode
from tests.arming import arm_on_page
from tests.browser.conftest import Boat
from tests.browser.test_legibility import SIDEWAYS
from tests.browser.test_page import until, watch
from tests.conftest import OpenAs, Spawn

pytestmark = [pytest.mark.browser, pytest.mark.timeout(120)]

WAIT_S = 20.0
LET_GO_S = 0.5
MANUAL = "[data-drive=MANUAL]"
PAD = """(axes) => { navigator.getGamepads = () => (axes ? [{ connected: true, axes }] : [null]); }"""
PRESS_B = """() => {
  const buttons = [false, true].map((pressed) => ({ pressed }));
  navigator.getGamepads = () => [null, { connected: true, axes: [0, 0], buttons }];
}"""
IS_WHEEL_WHOLE = "(({ scrollWidth, clientWidth }) => scrollWidth <= clientWidth)(document.querySelector('#wheel'))"
HIDE = """(hidden) => {
  Object.defineProperty(document, "hidden", { value: hidden, configurable: true });
  document.dispatchEvent(new Event("visibilitychange"));
}"""


class Orders:
    """What the operator's process orders."""

    def __init__(self, inbox: Latest[m.OperatorOrder]) -> None:
        self._inbox = inbox

    @property
    def mode(self) -> DriveMode | None:
        return None if self._inbox.value is None else self._inbox.value.mode

    @property
    def stick(self) -> tuple[float, float]:
        order = self._inbox.value
        return (0.0, 0.0) if order is None else (order.surge, order.turn)

    @property
    def is_overridden(self) -> bool:
        return self._inbox.value is not None and self._inbox.value.override

    async def until(self, condition: Callable[[Orders], bool], limit_s: float = WAIT_S) -> None:
        try:
            async with asyncio.timeout(limit_s):
                while not condition(self):
                    await asyncio.sleep(0.01)
        except TimeoutError:
            pytest.fail(f"not within {limit_s} s: {self._inbox.value}")


async def button_text(page: Any, mode: DriveMode) -> str:
    return str(await page.inner_text(f"[data-drive={mode}] span"))


async def drive_manually(page: Any, orders: Orders) -> None:
    await page.wait_for_selector(f"{MANUAL}:enabled", timeout=WAIT_S * 1e3)
    await page.click(MANUAL)
    await orders.until(lambda found: found.mode is DriveMode.MANUAL)
    await until(page, "document.querySelector('#drive').dataset.driving === 'true'")


async def test_a_hand_on_the_page_drives_while_it_holds_and_the_wheel_is_taken_over(
    browser: Any, boat: Boat, open_as: OpenAs, spawn: Spawn, config: Config, tmp_path: Path
) -> None:
    orders = Orders((await open_as("observer")).latest(keys.OPERATOR_ORDER))
    async with spawn("operator"), spawn("dashboard"):
        watched = await watch(browser, config)
        page = watched.page
        await until(page, "document.querySelector('[data-drive=HOLD] span').textContent.startsWith('position')")
        assert await button_text(page, DriveMode.MANUAL) == "arm first"
        assert await button_text(page, DriveMode.ROUTE) == "no mission and no route"
        assert await page.is_disabled(MANUAL)
        await arm_on_page(f"http://127.0.0.1:{config.dashboard.port}", config.bus)
        await drive_manually(page, orders)

        await page.keyboard.down("w")
        await page.keyboard.down("ArrowLeft")
        await orders.until(lambda found: found.stick == (1.0, 1.0))
        assert await page.inner_text("#drive-asks") == "Ahead 100 %, to port 100 %"
        assert await page.get_attribute("#stick", "data-held") == "true"
        await page.screenshot(path=tmp_path / "manual.png")
        await page.keyboard.up("ArrowLeft")
        await orders.until(lambda found: found.stick == (1.0, 0.0))
        await page.keyboard.up("w")
        await orders.until(lambda found: found.stick == (0.0, 0.0))
        assert orders.mode is DriveMode.MANUAL
        assert await page.inner_text("#drive-asks") == "Let go: zero thrust"
        assert await page.get_attribute("#stick", "data-held") == "false"

        for let_go in ("dispatchEvent(new Event('blur'))", "dispatchEvent(new Event('pagehide'))"):
            await page.keyboard.down("d")
            await orders.until(lambda found: found.stick == (0.0, -1.0))
            await page.evaluate(let_go)
            await orders.until(lambda found: found.stick == (0.0, 0.0))
            await page.keyboard.down("d")  # as a key repeats that is held
            await asyncio.sleep(0.3)
            assert orders.stick == (0.0, 0.0), "a key that is still down is pressed anew"
            await page.keyboard.up("d")

        await page.focus("#time-speed")
        await page.keyboard.down("ArrowDown")
        await asyncio.sleep(0.3)
        assert orders.stick == (0.0, 0.0), "a key goes into the field that it is pressed in"
        await page.keyboard.up("ArrowDown")
        await page.evaluate("document.activeElement.blur()")

        box = await page.locator("#stick").bounding_box()
        middle = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        await page.mouse.move(*middle)
        await page.mouse.down()
        await page.mouse.move(middle[0], middle[1] - box["height"] / 4)
        await orders.until(lambda found: found.stick == (0.5, 0.0))
        assert await page.inner_text("#drive-asks") == "Ahead 50 %"
        await page.mouse.up()
        await orders.until(lambda found: found.stick == (0.0, 0.0))

        await page.evaluate(PAD, [0.0, -0.5])
        await asyncio.sleep(0.3)
        assert orders.stick == (0.0, 0.0), "a gamepad that was held from before drives nothing"
        for axes, expected in (([0.1, 0.0], (0.0, 0.0)), ([1.0, -0.5], (0.5, -1.0))):
            await page.evaluate(PAD, axes)
            await orders.until(lambda found, expected=expected: found.stick == expected)  # type: ignore[misc]
            await asyncio.sleep(0.3)
        await until(page, "document.querySelector('#drive-asks').textContent === 'Ahead 50 %, to starboard 100 %'")
        await page.evaluate("dispatchEvent(new Event('blur'))")
        await orders.until(lambda found: found.stick == (0.0, 0.0))
        await asyncio.sleep(0.3)
        assert orders.stick == (0.0, 0.0)
        await page.evaluate(PAD, [0.0, 0.0])
        await asyncio.sleep(0.3)
        await page.evaluate(PAD, [0.0, 1.0])
        await orders.until(lambda found: found.stick == (-1.0, 0.0))
        await page.evaluate(PAD, None)
        await orders.until(lambda found: found.stick == (0.0, 0.0) and found.mode is DriveMode.MANUAL)

        await page.keyboard.down("w")
        await orders.until(lambda found: found.stick == (1.0, 0.0))
        await page.evaluate(HIDE, True)
        await orders.until(lambda found: found.stick == (0.0, 0.0) and found.mode is DriveMode.MANUAL)
        await orders.until(lambda found: found.mode is DriveMode.IDLE)
        await page.evaluate(HIDE, False)
        await page.keyboard.up("w")
        await drive_manually(page, orders)

        other = (await watch(browser, config)).page
        await other.wait_for_selector("#drive-take:visible", timeout=WAIT_S * 1e3)
        assert await other.is_disabled("[data-drive=IDLE]")
        assert "another page" in await other.inner_text("#drive-wheel")
        await other.set_viewport_size({"width": 360, "height": 740})
        await other.wait_for_timeout(300)
        assert await other.evaluate(SIDEWAYS) == [], "the button is whole on a phone"
        assert await other.evaluate(IS_WHEEL_WHOLE)
        await other.click("#drive-take")
        await orders.until(lambda found: found.mode is DriveMode.IDLE)
        await until(page, "document.querySelector('#drive').dataset.driving === 'false'")
        assert "another page" in await page.inner_text("#drive-wheel")
        await until(page, "document.querySelector('#wheel').textContent === 'another page'")
        assert await page.evaluate(IS_WHEEL_WHOLE)
        await until(other, "document.querySelector('#wheel').textContent === 'this page'")
        await drive_manually(other, orders)
        await page.keyboard.down("s")
        assert await page.evaluate("document.querySelector('#drive').dataset.driving") == "false"

        await other.keyboard.down("w")
        await orders.until(lambda found: found.stick == (1.0, 0.0))
        closed_us = WallClock().now_us()
        await other.close()
        await orders.until(lambda found: found.stick == (0.0, 0.0))
        assert (WallClock().now_us() - closed_us) * 1e-6 <= LET_GO_S
        await orders.until(lambda found: found.mode is DriveMode.IDLE)
        assert boat.arming.value is not None
        assert boat.arming.value.armed
        await page.evaluate(PRESS_B)
        async with asyncio.timeout(WAIT_S):
            while not boat.arming.value.stopped:
                await boat.arming.next()
        assert watched.errors == []
