"""The map draws what the boat is told and what it sees coming: fence, station, home, the way ahead, what moves."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from paani import keys
from paani import messages as m
from paani.clock import WallClock
from paani.config import Config
from tests.browser.guidance import guiding
from tests.browser.test_page import has_colour_on_map, until, watch
from tests.conftest import OpenAs, Spawn

pytestmark = [pytest.mark.browser, pytest.mark.timeout(120)]

GREEN, RED, AMBER, ORANGE, ROUTE = (77, 184, 133), (255, 113, 118), (227, 179, 65), (240, 152, 63), (185, 164, 240)


def points(*places: tuple[float, float]) -> tuple[m.Waypoint, ...]:
    return tuple(m.Waypoint(x_m=x_m, y_m=y_m) for x_m, y_m in places)


MISSION = m.Mission(
    source_us=0,
    name="bay",
    legs=(m.MissionLeg(kind=m.LegKind.HOLD_STATION, waypoints=points((0.0, -12.0)), radius_m=3.0),),
    fence=(
        m.FenceArea(keep=m.Keep.IN, corners=points((-20, -20), (20, -20), (20, 20), (-20, 20))),
        m.FenceArea(keep=m.Keep.OUT, corners=points((10, 5), (16, 5), (16, 12), (10, 12))),
    ),
)
SWIMMER = m.MovingObstacle(track_id=4, x_m=-8.0, y_m=8.0, radius_m=1.0, east_mps=0.0, north_mps=-1.0)
AHEAD = m.Prediction(
    source_us=0, path=points((0, 0), (3, 0), (6, 2)), obstacles=(SWIMMER,), home=points((-10, -10))
)  # fmt: skip


async def test_the_map_shows_what_the_boat_is_told_and_what_comes(
    browser: Any, open_as: OpenAs, spawn: Spawn, config: Config, tmp_path: Path
) -> None:
    async with spawn("dashboard"), guiding(open_as) as guidance:
        guidance.route = None
        guidance.odometry = replace(guidance.odometry, x_m=0.0, y_m=0.0) if guidance.odometry else None
        navigator = guidance.navigator
        missions, predictions = navigator.publisher(keys.MISSION), navigator.publisher(keys.PREDICTION)
        watched = await watch(browser, config)
        page = watched.page
        prediction: m.Prediction | None = AHEAD

        async def publish_forever() -> None:
            while True:
                now_us = WallClock().now_us()
                missions.put(replace(MISSION, source_us=now_us))
                if prediction is not None:
                    predictions.put(replace(prediction, source_us=now_us))
                await asyncio.sleep(0.2)

        publishing = asyncio.create_task(publish_forever())
        await until(page, "document.querySelector('#map-pose').textContent.startsWith('0.0 m E, 0.0 m N')")
        await page.wait_for_timeout(1000)
        await page.screenshot(path=tmp_path / "map.png")
        drawn = [
            ("the fence to stay in", GREEN, -20.0, 1.0), ("the fence to stay out of", RED, 10.0, 8.0),
            ("the station", ROUTE, 3.0, -12.0), ("home", ROUTE, -10.0, -8.67), ("the way ahead", AMBER, 3.0, 0.0),
            ("the swimmer", ORANGE, -8.0, 7.8), ("where they will be", ORANGE, -8.0, 4.5),
        ]  # fmt: skip
        for what, colour, east_m, north_m in drawn:
            assert await has_colour_on_map(page, colour, east_m, north_m), what
        assert not await has_colour_on_map(page, RED, 8.0, 8.0)
        prediction = None
        await page.wait_for_timeout(3600)
        assert not await has_colour_on_map(page, AMBER, 3.0, 0.0), "a way that is no longer said is no longer drawn"
        assert await has_colour_on_map(page, GREEN, -20.0, 1.0)
        publishing.cancel()
        assert watched.errors == []
