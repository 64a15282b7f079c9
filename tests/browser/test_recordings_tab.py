"""The recordings tab: list, protect, delete, download, and playing one in the page of a boat that goes on living."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import aiohttp
import pytest

from paani.config import Config
from tests.arming import headers_of
from tests.browser.conftest import Boat
from tests.browser.test_page import until, watch
from tests.browser.test_time import press_strip
from tests.conftest import Spawn
from tests.unit.paani.logs.small_logs import NAME, begin, fill, finished

pytestmark = [pytest.mark.browser, pytest.mark.timeout(120)]

RUNNING = "20231114T231320Z-2.mcap"
ROW = f"document.querySelector('#recordings [data-name=\"{NAME}\"]')"
SPEED = "document.querySelector('#speed').textContent"


async def press(page: Any, text: str) -> None:
    await page.click(f'#recordings [data-name="{NAME}"] button:has-text("{text}")')


@pytest.mark.rotating(cpu_s=5)
async def test_a_recording_is_played_protected_and_deleted(
    browser: Any, boat: Boat, spawn: Spawn, config: Config, tmp_path: Path
) -> None:
    folder = tmp_path / "drives"
    folder.mkdir()
    path = await asyncio.to_thread(finished, folder, 200, 20)
    log = await asyncio.to_thread(begin, folder, RUNNING)
    await asyncio.to_thread(fill, log, 20, 10)
    origin = f"http://127.0.0.1:{config.dashboard.port}"
    async with spawn("dashboard", f"recorder.folder={folder}"), aiohttp.ClientSession(origin) as client:
        watched = await watch(browser, config)
        page = watched.page
        await until(page, "paani.overlay.mask_seq !== null")
        await page.click("[data-tab-of='recordings']")
        await until(page, "document.querySelectorAll('#recordings tr').length === 2")
        assert "0:09" in await page.evaluate(f"{ROW}.textContent")
        await page.screenshot(path=tmp_path / "recordings.png")

        await press(page, "Replay here")
        await until(page, "document.querySelector('#past-word').textContent === 'RECORDING'")
        await until(page, f"{SPEED} === '0.50'")
        assert await page.inner_text("#mode") == "REPLAY"
        assert "Live now: " in await page.inner_text("#past-live")
        assert await page.evaluate("document.querySelector('#arm').disabled && document.querySelector('#drive').hidden")
        await until(page, "document.querySelectorAll('#health tr').length > 5")
        words = await page.evaluate("[...document.querySelectorAll('#health tr')].map((r) => r.children[1].className)")
        assert "bad" not in words
        at_us = await page.evaluate("paani.shownUs")
        await until(page, f"paani.shownUs > {at_us} + 5e5")
        await page.click("#time-play")
        await press_strip(page, 0.5)
        await until(page, "document.querySelector('#map-pose').textContent.startsWith('9.') || "
                          "document.querySelector('#map-pose').textContent.startsWith('10.')")  # fmt: skip
        middle_us = await page.evaluate("paani.shownUs")
        assert await page.inner_text("#explanation") == "", "no advice was recorded, and the present's is not shown"
        assert "buoy" not in await page.inner_text("#tracks")
        await page.screenshot(path=tmp_path / "playing.png")
        await page.click("#time-next")
        assert await page.evaluate("paani.shownUs") > middle_us
        await press_strip(page, 0.0)
        await until(page, "document.querySelector('#map-pose').textContent.startsWith('0.0 m E')")
        await page.keyboard.press("l")
        await until(page, "paani.shownUs === null && document.querySelector('#mode').textContent === 'SIM'")

        await page.click("[data-tab-of='recordings']")
        await until(page, f"{ROW} !== null")
        await press(page, "Protect")
        await until(page, f"{ROW}.textContent.includes('protected')")
        assert path.with_name(f"{NAME}.keep").exists()
        ours = await asyncio.to_thread(headers_of, origin, config.bus)
        for act, headers, body, status, field in (
            ("delete", ours, {"name": NAME}, 409, "name"),
            ("delete", ours, {"name": RUNNING}, 409, "name"),
            ("delete", ours, {"name": f"../drives/{NAME}"}, 404, "name"),
            ("delete", ours, {"name": NAME, "force": True}, 400, "force"),
            ("delete", {}, {"name": NAME}, 403, "Origin"),
            ("protect", {"Origin": origin}, {"name": NAME, "protected": False}, 403, "X-Paani-Key"),
            ("protect", ours, {"name": "x" * 5000, "protected": False}, 413, "/api/recordings/protect"),
        ):
            async with client.post(f"/api/recordings/{act}", json=body, headers=headers) as answer:
                assert (answer.status, (await answer.json())["field"]) == (status, field), body
        for part, status in (
            ("..%2Fdrives/file", 404), ("absent.mcap/series", 404), (f"{NAME}/file?all=1", 400),
            (f"{NAME}/frames?from_us=0&to_us=99000000", 400),
        ):  # fmt: skip
            async with client.get(f"/api/recordings/{part}") as answer:
                assert answer.status == status, part
        async with client.get(f"/api/recordings/{NAME}/file") as answer:
            assert answer.headers["Content-Disposition"] == f'attachment; filename="{NAME}"'
            assert await answer.read() == await asyncio.to_thread(path.read_bytes)

        await press(page, "Unprotect")
        await until(page, f"!{ROW}.textContent.includes('protected')")
        await press(page, "Delete")
        assert path.exists(), "one press deletes nothing"
        await press(page, "Press again")
        await until(page, f"{ROW} === null")
        assert not path.exists()
        assert (folder / RUNNING).exists()
        assert watched.errors == []
    log.abandon()
