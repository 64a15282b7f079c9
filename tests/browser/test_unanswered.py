"""What the page does where an answer or one of its own files never comes, or it has to ask first."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from paani import keys
from paani.config import Config
from paani.operator_key import ensure_operator_key
from tests.arming import arm_on_page
from tests.browser.conftest import Boat
from tests.browser.test_drive import WAIT_S, Orders, drive_manually
from tests.browser.test_page import hold_to_arm, until, wait_for_arming, watch
from tests.conftest import OpenAs, Spawn

pytestmark = [pytest.mark.browser, pytest.mark.timeout(120)]

# How often STOP was asked after each of: a press, a second press, the answer to the first, the answer to the second.
PRESS_TWICE = """async () => {
  const answers = [], counts = [];
  document.body.innerHTML = '<button id="stop"></button>';
  window.fetch = () => new Promise((resolve) => answers.push(() => resolve({ ok: true })));
  const { bindStop } = await import("/static/stop.js");
  bindStop(() => {});
  const press = () => dispatchEvent(new KeyboardEvent("keydown", { key: "Escape" }));
  for (const act of [press, press, () => answers[0](), () => answers[1]?.()]) {
    act();
    await new Promise((resolve) => setTimeout(resolve, 100));
    counts.push(answers.length);
  }
  return counts;
}"""


class Silence:
    """Requests that are kept without an answer, as on a link that is dead, for as long as it lasts.

    `most_waiting` is how many of them waited at a time, as the page gives each up after a while; a stick that was just
    let go is said at any time, and not counted.
    """

    def __init__(self, page: Any, most: int | None = None) -> None:
        self.kept, self.most_waiting, self._most = 0, 0, most
        self._drives = False
        self._waiting: set[Any] = set()
        page.on("requestfailed", lambda request: self._waiting.discard(request))

    async def __call__(self, route: Any) -> None:
        if self._most is not None and self.kept >= self._most:
            await route.continue_()
            return
        self.kept += 1
        body = route.request.post_data_json or {}
        drove, self._drives = self._drives, any(body.get(axis, 0) != 0 for axis in ("surge", "turn"))
        if self._drives or not drove:
            self._waiting.add(route.request)
        self.most_waiting = max(self.most_waiting, len(self._waiting))

    def end(self) -> None:
        self._most = 0


async def drive_without_answers(browser: Any, config: Config, orders: Orders) -> tuple[Any, Silence]:
    """A page that drives by hand, of whose set-points none is answered any more."""
    page = (await watch(browser, config)).page
    await arm_on_page(f"http://127.0.0.1:{config.dashboard.port}", config.bus)
    await drive_manually(page, orders)
    dead = Silence(page)
    await page.route("**/api/drive/setpoint", dead)
    return page, dead


async def test_a_stop_without_an_answer_is_asked_again_on_a_new_connection(
    browser: Any, boat: Boat, spawn: Spawn, config: Config
) -> None:
    async with spawn("operator"), spawn("dashboard"):
        page = (await watch(browser, config)).page
        await until(page, "document.querySelector('#order-word').textContent === 'STOPPED'")
        await page.route("**/api/stop", Silence(page, most=1))
        await page.keyboard.press("Escape")
        await until(page, "document.querySelector('#order-word').textContent === 'NOT CONFIRMED'")
        await until(
            page, "document.querySelector('#order-detail').textContent.startsWith('confirmed by the thrust adapter in')"
        )


async def test_a_press_while_an_earlier_stop_waits_for_its_answer_is_asked_for_too(scripts_page: Any) -> None:
    """The boat may have been armed since that one was latched."""
    assert await scripts_page.evaluate(PRESS_TWICE) == [1, 1, 2, 2]


async def test_a_hand_drives_again_after_a_link_that_swallowed_what_it_said(
    browser: Any, boat: Boat, open_as: OpenAs, spawn: Spawn, config: Config
) -> None:
    orders = Orders((await open_as("observer")).latest(keys.OPERATOR_ORDER))
    async with spawn("operator"), spawn("dashboard"):
        page, dead = await drive_without_answers(browser, config, orders)
        await page.keyboard.down("w")
        await until(page, "document.querySelector('#drive-note').textContent === 'no answer from the dashboard'")
        assert dead.most_waiting == 3, "no more wait for an answer at once, or a STOP would find no connection"
        await page.keyboard.up("w")
        dead.end()
        await drive_manually(page, orders)
        await page.keyboard.down("w")
        await orders.until(lambda found: found.stick == (1.0, 0.0))
        await page.keyboard.up("w")


async def test_a_stick_at_rest_leaves_room_for_a_stop_on_a_link_that_is_dead(
    browser: Any, boat: Boat, open_as: OpenAs, spawn: Spawn, config: Config
) -> None:
    orders = Orders((await open_as("observer")).latest(keys.OPERATOR_ORDER))
    async with spawn("operator"), spawn("dashboard"):
        page, dead = await drive_without_answers(browser, config, orders)
        await until(page, "document.querySelector('#drive-note').textContent === 'no answer from the dashboard'")
        assert dead.most_waiting == 3


async def test_holds_without_an_answer_leave_room_for_a_stop(
    browser: Any, boat: Boat, spawn: Spawn, config: Config
) -> None:
    async with spawn("operator"), spawn("dashboard"):
        page = (await watch(browser, config)).page
        await until(page, "!document.querySelector('#arm').disabled")
        dead = Silence(page)
        await page.route("**/api/arm/*", dead)
        await page.focus("#arm")
        await page.keyboard.down("Enter")
        await page.wait_for_timeout(1500)
        assert dead.most_waiting == 3
        await page.evaluate("document.querySelector('#arm').blur()")


async def test_why_an_earlier_press_did_not_arm_is_not_said_of_an_armed_boat(
    browser: Any, boat: Boat, spawn: Spawn, config: Config
) -> None:
    detail = "document.querySelector('#order-detail').textContent"
    async with spawn("operator"), spawn("dashboard"):
        page = (await watch(browser, config)).page

        async def refuse(route: Any) -> None:
            await route.fulfill(status=409, json={"error": "not armed: the hold was interrupted", "field": "press"})

        await page.route("**/api/arm/*", refuse)
        await hold_to_arm(page, 0.3)
        await until(page, f"{detail} === 'not armed: the hold was interrupted'")
        await arm_on_page(f"http://127.0.0.1:{config.dashboard.port}", config.bus)
        await until(page, f"{detail} === 'by the page, route'")


async def test_a_page_without_one_of_its_files_is_loaded_again(
    browser: Any, boat: Boat, spawn: Spawn, config: Config
) -> None:
    async with spawn("dashboard"):
        for name in ("stop.js", "bar.css", "uPlot.iife.min.js"):
            page = await browser.new_page()
            loads: asyncio.Queue[Any] = asyncio.Queue()
            page.on("domcontentloaded", loads.put_nowait)
            await page.route(f"**/static/{name}", lambda route: route.abort(), times=1)
            await page.goto(f"http://127.0.0.1:{config.dashboard.port}/")
            async with asyncio.timeout(WAIT_S):
                await loads.get()
                await loads.get()
            await page.wait_for_selector("body[data-link='live']", timeout=WAIT_S * 1e3)
            await page.close()


async def test_a_press_that_had_to_ask_for_the_key_holds_nothing(
    browser: Any, boat: Boat, spawn: Spawn, config: Config
) -> None:
    """Whoever types has let go of the button, of which the page hears nothing."""
    key = await asyncio.to_thread(ensure_operator_key, config.bus)
    async with spawn("operator"), spawn("dashboard"):
        page, held = await browser.new_page(), []
        page.on("request", lambda request: held.append(request.url) if request.url.endswith("/arm/hold") else None)
        page.on("dialog", lambda dialog: dialog.accept(key))
        await page.goto(f"http://127.0.0.1:{config.dashboard.port}")
        await until(page, "!document.querySelector('#arm').disabled")
        await page.hover("#arm")
        await page.mouse.down()
        await until(page, "sessionStorage.getItem('paani-key') !== null")
        await asyncio.sleep(0.5)
        assert held == []
        await page.mouse.up()
        await hold_to_arm(page)
        await wait_for_arming(boat, armed=True, stopped=False)
