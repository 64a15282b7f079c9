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
from tests.browser.test_page import until, watch
from tests.conftest import OpenAs, Spawn

pytestmark = [pytest.mark.browser, pytest.mark.timeout(120)]


@pytest.fixture
def private_sets(private_sets: tuple[str, ...]) -> tuple[str, ...]:
    return (*private_sets, f"bus.vessel=otter{keys.REPLAY_SUFFIX}")


async def test_a_replay_raises_no_alarm(
    browser: Any, open_as: OpenAs, spawn: Spawn, config: Config, tmp_path: Path
) -> None:
    odometry = (await open_as("localization")).publisher(keys.ODOMETRY)
    async with spawn("dashboard"):
        watched = await watch(browser, config)
        page = watched.page
        for _ in range(8):
            odometry.put(m.Odometry(source_us=WallClock().now_us(), x_m=1.0, y_m=2.0, yaw_rad=0.0, surge_mps=0.4))
            await asyncio.sleep(0.1)
        await until(page, "document.querySelector('#speed').textContent === '0.40'")
        assert await page.inner_text("#mode") == "REPLAY"
        await until(page, "paani.link === 'ended'")
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
