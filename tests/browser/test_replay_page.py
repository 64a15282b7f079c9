"""The page of a recording that is played again: unmistakable, read-only, and no alarm for what need not run."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest

from paani import keys
from paani import messages as m
from paani.clock import WallClock
from paani.config import Config
from tests.browser.test_page import RED_ON_MAP, until, watch
from tests.browser.test_time import press_strip
from tests.conftest import OpenAs, Spawn
from tests.unit.paani.logs.small_logs import NAME, START_US, finished

pytestmark = [pytest.mark.browser, pytest.mark.timeout(120)]


@pytest.fixture
def private_sets(private_sets: tuple[str, ...]) -> tuple[str, ...]:
    return (*private_sets, f"bus.vessel=otter{keys.REPLAY_SUFFIX}")


@pytest.mark.rotating(cpu_s=3)
async def test_a_replay_raises_no_alarm(
    browser: Any, open_as: OpenAs, spawn: Spawn, config: Config, tmp_path: Path
) -> None:
    odometry = (await open_as("localization")).publisher(keys.ODOMETRY)
    async with spawn("dashboard"):
        watched = await watch(browser, config)
        page = watched.page
        async with asyncio.timeout(30.0):  # however long the page takes to begin
            while await page.inner_text("#speed") != "0.40":
                odometry.put(m.Odometry(source_us=WallClock().now_us(), x_m=1.0, y_m=2.0, yaw_rad=0.0, surge_mps=0.4))
                await asyncio.sleep(0.1)
        assert await page.inner_text("#mode") == "REPLAY"
        await until(page, "paani.link === 'ended'")
        await page.wait_for_timeout(300)
        assert not await page.evaluate(RED_ON_MAP), "nobody is lost where a recording ends"
        assert await page.inner_text("#order-word") == "READ-ONLY"
        assert await page.evaluate("document.querySelector('#arm').disabled")
        words = await page.evaluate(
            "[...document.querySelectorAll('#health tr')].map((row) => row.children[1].className)"
        )
        assert len(words) > 5
        assert "bad" not in words
        await page.screenshot(path=tmp_path / "replay.png")
        red = "getComputedStyle(document.documentElement).getPropertyValue('--red')"
        assert (
            await page.evaluate(f"""(() => {{
            const probe = document.body.appendChild(document.createElement("i"));
            probe.style.color = {red};
            const colour = getComputedStyle(probe).color;
            probe.remove();
            return [...document.querySelectorAll("body *")].filter((e) => e.offsetParent && e.textContent.trim() &&
              !e.children.length && getComputedStyle(e).color === colour).map((e) => e.textContent);
        }})()""")
            == []
        )
        assert watched.errors == []


@pytest.mark.rotating(cpu_s=6)
async def test_the_replayed_file_is_played_by_the_same_controls(
    browser: Any, spawn: Spawn, config: Config, tmp_path: Path
) -> None:
    """Ten seconds at 2 m/s: at once, from where the command says; paused, stepped, sought, faster, once more."""
    path = await asyncio.to_thread(finished, tmp_path, 200, 20)
    x_m = "parseFloat(document.querySelector('#map-pose').textContent)"
    play = "document.querySelector('#time-play').ariaLabel"
    async with spawn("dashboard", f"dashboard.replayed={path}"):
        watched = await watch(browser, config)
        page = watched.page
        await page.goto(f"http://127.0.0.1:{config.dashboard.port}/#at=4")
        await page.reload()
        await until(page, "paani.shownUs !== null")
        assert START_US + 4e6 <= await page.evaluate("paani.shownUs") < START_US + 7e6
        await until(page, f"{play} === 'Pause' && {x_m} >= 8")
        assert NAME in await page.inner_text("#past-what")
        assert await page.inner_text("#past-live") == "No boat is steered from this page"
        assert await page.inner_text("#mode") == "REPLAY"
        assert not await page.is_visible("#past-live-button")
        await page.keyboard.press("k")
        await until(page, f"{play} === 'Play'")
        paused_us = await page.evaluate("paani.shownUs")
        assert paused_us >= START_US + 4_000_000
        await page.keyboard.press("l")
        await page.click("#time-next")
        assert 0 < await page.evaluate("paani.shownUs") - paused_us < 1.5e6
        await press_strip(page, 0.8)
        await until(page, f"{x_m} >= 15 && {x_m} < 17")
        await page.screenshot(path=tmp_path / "replayed.png")
        await page.select_option("#time-speed", "5")
        await page.click("#time-play")
        await until(page, f"{play} === 'Play' && {x_m} >= 19")
        await page.select_option("#time-speed", "1")
        await page.click("#time-play")
        await until(page, f"{play} === 'Pause' && {x_m} < 15")
        assert watched.errors == []


@pytest.mark.rotating(cpu_s=4)
async def test_a_replay_that_could_not_be_read_at_first_is_read_again(
    browser: Any, spawn: Spawn, config: Config, tmp_path: Path
) -> None:
    """Its samples by themselves, as on a machine that is busy when the page opens; its messages at a press of Play."""
    path = await asyncio.to_thread(finished, tmp_path, 200, 20)
    refused = {"series": 1, "frames": 1}

    async def answer(route: Any) -> None:
        what = "series" if "/series" in route.request.url else "frames"
        refused[what] -= 1
        if refused[what] < 0:
            await route.continue_()
        else:
            await route.fulfill(status=503, json={"error": f"{what}: busy"})

    async with spawn("dashboard", f"dashboard.replayed={path}"):
        page = await browser.new_page(service_workers="block")
        await page.route("**/api/replayed/**", answer)
        await page.goto(f"http://127.0.0.1:{config.dashboard.port}/")
        await until(page, "document.querySelector('#past-what').textContent.endsWith('frames: busy')")
        assert "series: busy" in await page.text_content("#log")
        await page.click("#time-play")
        await until(page, "document.querySelector('#map-pose').textContent.startsWith('4.')")
