"""The shore's page in a browser: two vessels with routers and operators of their own, one of which is stopped."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest

from paani import messages as m
from paani.config import Config
from paani_tools.fleet.fleet_file import read_fleet
from paani_tools.fleet.page import serve_page
from paani_tools.fleet.shore import watch_fleet
from tests.at_work import at_work
from tests.bus_peers import joined
from tests.integration.test_fleet import CLOCK, afloat, fleet_file, make_vessels
from tests.integration.test_operator import Boat, station

pytestmark = [pytest.mark.browser, pytest.mark.timeout(90)]
CELLS = "line => Object.fromEntries([...line.cells].map(cell => [cell.className, cell.textContent]))"
MARKS_FROM_NORTH = """[...document.querySelectorAll("#map g")].sort((a, b) => a.getBBox().y - b.getBBox().y)
  .map((mark) => mark.querySelector("text").textContent).join(", ")"""


@contextlib.asynccontextmanager
async def driving(config: Config, latitude_deg: float) -> AsyncIterator[Boat]:
    """A vessel that a hand at its own page has armed."""
    async with afloat(config, latitude_deg), joined(config.bus, "plant") as bus, station(config) as hand:
        boat = Boat(bus)
        async with at_work(boat.report_forever()):
            assert await hand.hold_to_arm() is m.ArmRefusal.NONE
            await boat.until(lambda: boat.is_armed, "armed")
            yield boat


async def test_two_vessels_on_the_page_and_a_stop_of_one(browser: Any, tmp_path: Path) -> None:
    """Two that drive, in the table and on the map, north up; a button stops its own; what is lost is shown so."""
    otter, beaver = await asyncio.to_thread(make_vessels, tmp_path, "otter", "beaver")
    fleet = await asyncio.to_thread(read_fleet, await asyncio.to_thread(fleet_file, tmp_path, otter, beaver))
    port = asyncio.get_running_loop().create_future()
    page = await browser.new_page()
    faults: list[str] = []
    page.on("pageerror", lambda error: faults.append(str(error)))
    page.on("console", lambda message: faults.append(message.text) if message.type == "error" else None)
    async with driving(otter, 50.1) as stopped, watch_fleet(fleet, CLOCK) as vessels:
        async with at_work(serve_page(vessels, 0, port.set_result)):
            async with driving(beaver, 50.1005) as other:
                await page.goto(f"http://127.0.0.1:{await port}/")
                await page.wait_for_function("document.querySelectorAll('#map g.live').length === 2")
                await page.get_by_text("2 of 2 vessels live").wait_for()
                await page.wait_for_function(f"{MARKS_FROM_NORTH} === 'beaver, otter'")
                await page.get_by_role("button", name="STOP otter").click()
                lines = page.locator("#vessels tr")
                await lines.nth(0).get_by_text("STOPPED by shore").wait_for()
                assert await lines.nth(0).get_by_role("status").text_content() == "latched"
                rows = await lines.evaluate_all(f"lines => lines.map({CELLS})")
                assert [row["name"] for row in rows] == ["otter", "beaver"]
                assert all(row["contact"].startswith("live") and row["position"] == "1.0, 2.0" for row in rows)
                assert rows[1]["mode"] == "armed by dashboard"
                await stopped.until(lambda: not stopped.is_armed, "disarmed by the shore")
                assert other.is_armed
            await page.get_by_text("1 of 2 vessels live").wait_for()
        await page.get_by_text("everything here is old").wait_for()
    assert [fault for fault in faults if "ERR_CONNECTION_REFUSED" not in fault] == []
