"""A phone's page under real fingers: the stick, a second finger on STOP, and a touch that the system takes away."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from typing import Any

import pytest

from paani import keys
from paani.config import Config
from paani.messages import DriveMode
from paani.operator_key import ensure_operator_key
from tests.arming import arm_on_page
from tests.browser.conftest import Boat
from tests.browser.test_drive import MANUAL, WAIT_S, Orders
from tests.browser.test_page import Watched, until
from tests.conftest import OpenAs, Spawn

pytestmark = [pytest.mark.browser, pytest.mark.timeout(120)]

Place = tuple[float, float]
SCROLLED = "[scrollX, scrollY]"
HELD = "document.querySelector('#stick').dataset.held"


class Fingers:
    """Fingers on a page's screen, by number; each change is one touch event of the system, as a browser gets it."""

    def __init__(self, session: Any) -> None:
        self._session = session
        self._down: dict[int, Place] = {}

    async def press(self, finger: int, at: Place) -> None:
        self._down[finger] = at
        await self._send("touchStart", self._down)

    async def move(self, finger: int, to: Place) -> None:
        self._down[finger] = to
        await self._send("touchMove", self._down)

    async def lift(self, finger: int) -> None:
        await self._send("touchEnd", {finger: self._down.pop(finger)})

    async def lose(self) -> None:
        """The system takes all of them away, as for a call or a gesture of its own."""
        self._down.clear()
        await self._send("touchCancel", {})

    async def _send(self, kind: str, touches: dict[int, Place]) -> None:
        points = [{"x": x, "y": y, "id": finger} for finger, (x, y) in touches.items()]
        await self._session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})


async def middle(page: Any, name: str) -> Place:
    box = await page.locator(name).bounding_box()
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


async def drive_by_touch(page: Any, fingers: Fingers, orders: Orders) -> Place:
    """MANUAL by a tap; the middle of the stick."""
    await page.wait_for_selector(f"{MANUAL}:enabled", timeout=WAIT_S * 1e3)
    await page.locator(MANUAL).scroll_into_view_if_needed()
    await page.tap(MANUAL)
    await orders.until(lambda found: found.mode is DriveMode.MANUAL)
    await until(page, "document.querySelector('#drive').dataset.driving === 'true'")
    await page.wait_for_timeout(500)  # the page scrolls to what one drives by
    return await middle(page, "#stick")


@pytest.fixture
async def phone(
    browser: Any, boat: Boat, open_as: OpenAs, spawn: Spawn, config: Config
) -> AsyncIterator[tuple[Any, Fingers, Orders]]:
    """The page of an armed boat on a phone, fingers on it, and what is ordered."""
    orders = Orders((await open_as("observer")).latest(keys.OPERATOR_ORDER))
    origin = f"http://127.0.0.1:{config.dashboard.port}"
    async with spawn("operator"), spawn("dashboard"):
        context = await browser.new_context(
            viewport={"width": 360, "height": 740}, has_touch=True, is_mobile=True, device_scale_factor=2
        )
        page = await context.new_page()
        watched = Watched(page, origin)
        key = await asyncio.to_thread(ensure_operator_key, config.bus)
        await page.goto(f"{origin}/#key={key}")
        await until(page, "paani.overlay.mask_seq !== null")
        await arm_on_page(origin, config.bus)
        yield page, Fingers(await context.new_cdp_session(page)), orders
        assert watched.errors == []
        await context.close()


class LateHand(Exception):
    """The page was not run for so long that the hand was taken for gone, as it has to be."""


async def until_driven(orders: Orders, stick: tuple[float, float]) -> None:
    await orders.until(lambda found: found.stick == stick or found.mode is not DriveMode.MANUAL)
    if orders.mode is not DriveMode.MANUAL:
        raise LateHand


async def hold_with_a_second_finger(page: Any, fingers: Fingers, orders: Orders) -> None:
    x, y = await drive_by_touch(page, fingers, orders)
    scrolled = await page.evaluate(SCROLLED)
    await fingers.press(1, (x, y))
    await fingers.move(1, (x, y - 37))
    await until_driven(orders, (0.5, 0.0))
    await fingers.press(2, (x + 30, y + 30))
    await fingers.move(2, (x + 40, y + 40))
    await asyncio.sleep(0.3)
    await until_driven(orders, (0.5, 0.0))  # another finger does not move it
    await fingers.lift(2)
    await asyncio.sleep(0.3)
    await until_driven(orders, (0.5, 0.0))  # nor let it go
    await fingers.move(1, (x + 200, y))
    await until_driven(orders, (0.0, -1.0))
    assert await page.evaluate(SCROLLED) == [0, scrolled[1]], "the page stays where it is"
    await fingers.lift(1)
    await until_driven(orders, (0.0, 0.0))
    assert await page.evaluate(HELD) == "false"


async def test_one_finger_holds_the_stick_and_no_other_moves_it_or_lets_it_go(
    phone: tuple[Any, Fingers, Orders],
) -> None:
    """It is held for a second and more, in which a machine that does much else may let the page stand once."""
    page, fingers, orders = phone
    for _ in range(4):
        try:
            return await hold_with_a_second_finger(page, fingers, orders)
        except LateHand:
            await fingers.lose()
    pytest.fail("the hand was late each time")


async def test_a_touch_that_the_system_takes_away_lets_the_stick_go(phone: tuple[Any, Fingers, Orders]) -> None:
    page, fingers, orders = phone
    x, y = await drive_by_touch(page, fingers, orders)
    await fingers.press(1, (x, y - 37))
    await orders.until(lambda found: found.stick == (0.5, 0.0))
    await fingers.lose()
    await orders.until(lambda found: found.stick == (0.0, 0.0))
    await asyncio.sleep(0.3)
    assert (orders.stick, await page.evaluate(HELD)) == ((0.0, 0.0), "false")


@pytest.mark.parametrize("size", [(360, 740), (740, 360)])
async def test_a_second_finger_on_stop_wins_over_the_one_on_the_stick(
    phone: tuple[Any, Fingers, Orders], boat: Boat, size: tuple[int, int]
) -> None:
    page, fingers, orders = phone
    await page.set_viewport_size({"width": size[0], "height": size[1]})
    x, y = await drive_by_touch(page, fingers, orders)
    await fingers.press(1, (x, y - 37))
    await orders.until(lambda found: found.stick == (0.5, 0.0))
    await fingers.press(2, await middle(page, "#stop"))
    assert boat.arming.value is not None
    async with asyncio.timeout(WAIT_S):
        while not boat.arming.value.stopped:
            await boat.arming.next()
    await orders.until(lambda found: found.stick == (0.0, 0.0) and found.mode is DriveMode.IDLE)
    await fingers.lift(2)
    await fingers.move(1, (x, y + 37))
    await asyncio.sleep(0.5)
    assert (orders.stick, orders.mode) == ((0.0, 0.0), DriveMode.IDLE), "a finger that is still down drives nothing"
    assert boat.arming.value.stopped
