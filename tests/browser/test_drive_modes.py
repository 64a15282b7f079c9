"""Modes ordered on the page, one after the other, and the advice overridden: shown, logged, over by itself."""

from __future__ import annotations

from typing import Any

import pytest
from msgspec.structs import replace

from paani import keys
from paani import messages as m
from paani.config import Config
from paani.messages import DriveMode
from tests.arming import arm_on_page
from tests.at_work import at_work
from tests.browser.conftest import Boat
from tests.browser.guidance import ORDER, guiding, repeat
from tests.browser.test_drive import HIDE, WAIT_S, Orders, button_text, drive_manually
from tests.browser.test_map_objects import AHEAD
from tests.browser.test_page import until, watch
from tests.conftest import OpenAs, Spawn

pytestmark = [pytest.mark.browser, pytest.mark.timeout(120)]

NOTE, OVERRIDE, WORD, LOG = (
    f"document.querySelector('#{name}').textContent" for name in ("drive-note", "drive-override", "order-detail", "log")
)
ENDED = "the advice is no longer overridden: "
ORDERED = (DriveMode.HOLD, DriveMode.RETURN, DriveMode.IDLE, DriveMode.ROUTE)


@pytest.mark.rotating(cpu_s=10)
async def test_each_mode_is_ordered_on_the_page_and_the_advice_overridden_on_purpose(
    browser: Any, boat: Boat, open_as: OpenAs, spawn: Spawn, config: Config
) -> None:
    orders = Orders((await open_as("observer")).latest(keys.OPERATOR_ORDER))
    async with (
        spawn("operator"),
        spawn("dashboard"),
        guiding(open_as) as guidance,
        at_work(repeat(guidance.navigator.publisher(keys.PREDICTION), AHEAD, 0.2)),
    ):
        watched = await watch(browser, config)
        page = watched.page
        await arm_on_page(f"http://127.0.0.1:{config.dashboard.port}", config.bus)
        for mode in ORDERED:
            button = f"[data-drive={mode}]"
            await page.wait_for_selector(f"{button}:enabled", timeout=WAIT_S * 1e3)
            await page.click(button)
            await orders.until(lambda found, mode=mode: found.mode is mode)  # type: ignore[misc]
            await until(page, f"document.querySelector('{button}').ariaPressed === 'true'")
            assert await page.locator("[data-drive][aria-pressed=true]").count() == 1
            await until(page, f"{WORD} === 'by the page, {mode.lower()}'")
            await until(page, f"{LOG}.includes('{mode.capitalize()}: ordered by the page')")
        assert await button_text(page, DriveMode.RETURN) == "goes home or to a nearer rally point, keeps station there"

        assert not await page.is_visible("#drive-override")
        await drive_manually(page, orders)
        guidance.order = replace(ORDER, leg="manual", speed_mps=0.0, vetoes=(m.Inhibit.BLOCKED_AHEAD,))
        await until(page, f"{NOTE} === 'The advice gives no thrust ahead'")
        await page.click("#drive-override")
        await orders.until(lambda found: found.is_overridden)
        await until(page, f"{OVERRIDE}.startsWith('Advice overridden, ')")
        assert await page.get_attribute("#drive-override", "data-on") == "true"
        await until(page, f"{LOG}.includes('the page overrides the advice')")
        await orders.until(lambda found: not found.is_overridden)
        await until(page, f"{OVERRIDE} === 'Override the advice for 10 s'")
        assert orders.mode is DriveMode.MANUAL
        await until(page, f"{LOG}.includes('{ENDED}its time is over')")
        await page.click("#drive-override")
        await orders.until(lambda found: found.is_overridden)
        await page.click("[data-drive=IDLE]")
        await until(page, f"{LOG}.includes('{ENDED}its hand ordered a mode')")
        await drive_manually(page, orders)
        await page.click("#drive-override")
        await orders.until(lambda found: found.is_overridden)
        await page.evaluate(HIDE, True)
        await until(page, f"{LOG}.includes('{ENDED}its hand was not heard any more')")
        assert watched.errors == []
