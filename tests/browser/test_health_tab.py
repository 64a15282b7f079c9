"""The health tab: what a process says of itself, how long it takes, what it dropped and why, and its log."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from paani import keys
from paani import messages as m
from paani.clock import WallClock
from paani.config import Config
from paani.runtime import LOGS, runtime_path
from tests.at_work import at_work
from tests.browser.conftest import Boat
from tests.browser.test_page import until, watch
from tests.conftest import OpenAs, Spawn

pytestmark = [pytest.mark.browser, pytest.mark.timeout(120)]


def cells(name: str) -> str:
    """The texts of a process's row."""
    row = f"[...document.querySelectorAll('#health tr')].find((row) => row.children[0].textContent === '{name}')"
    return f"[...{row}.children].map((cell) => cell.textContent)"


@pytest.mark.rotating(cpu_s=6)
async def test_a_row_for_each_process_and_the_last_lines_of_its_log(
    browser: Any, boat: Boat, open_as: OpenAs, spawn: Spawn, config: Config
) -> None:
    folder = runtime_path(config.bus) / LOGS
    await asyncio.to_thread(folder.mkdir, exist_ok=True)
    await asyncio.to_thread((folder / "navigator.log").write_text, "one\ntwo\n", encoding="utf-8")
    reports = (await open_as("navigator")).publisher(keys.health("navigator"))

    async def report() -> None:
        while True:
            reports.put(
                m.Health(
                    source_us=WallClock().now_us(), service="navigator", ready=True, uptime_s=9.0, cpu_cores=0.25,
                    rss_mib=61.4, open_files=23, temperature_c=48.6, note="plans",
                    drops=(m.DropCount(cause="stale", count=3), m.DropCount(cause="future", count=0)),
                )
            )  # fmt: skip
            await asyncio.sleep(0.5)

    async with at_work(report()), spawn("operator"), spawn("dashboard"):
        watched = await watch(browser, config)
        page = watched.page
        await page.click("[data-tab-of='health']")
        await until(page, "document.querySelectorAll('#health tr').length > 5")
        await until(page, f"{cells('operator')}[1] === 'ready'")
        await until(page, f"{cells('navigator')}[6] === '25 %'")
        assert (await page.evaluate(cells("navigator")))[7:10] == ["61", "23", "49"]
        assert (await page.evaluate(cells("navigator")))[10:] == ["1", "stale 3", "plans"]
        await until(page, f"{cells('advisor')}[3].endsWith(' ms') && {cells('advisor')}[4].endsWith(' ms')")
        p50_ms, p95_ms = (float(text.removesuffix(" ms")) for text in (await page.evaluate(cells("advisor")))[3:5])
        assert 0.0 <= p50_ms <= p95_ms < 1000.0
        assert "of" in await page.inner_text("#health-sum")
        await page.click("#health button:text-is('navigator')")
        await until(page, "document.querySelector('#process-log-text').textContent === 'one\\ntwo'")
        assert await page.inner_text("#process-log-title") == "Log of navigator"
        assert watched.errors == []
