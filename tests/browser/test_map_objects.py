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
from tests.browser.test_page import MAP_PX_PER_M, TRACK_RGB, has_colour_on_map, until, watch
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


async def check_bow_up(page: Any, folder: Path) -> None:
    """The boat heads east: what lies north of it is on its left, until a mission is drawn, and after a reload too."""
    await page.click("#map-up")
    up = "document.querySelector('#map-up-name').textContent"
    await until(page, f"{up} === 'Bow'")
    below_m = 0.22 * await page.evaluate("document.querySelector('#map').clientHeight") / MAP_PX_PER_M
    drawn = (
        ("the swimmer", ORANGE, -7.8, -8.0), ("home", ROUTE, 8.67, -10.0), ("the way ahead", AMBER, 0.0, 3.0),
        ("the bow", TRACK_RGB, 0.0, 1.0),
    )  # fmt: skip
    for what, colour, right_m, ahead_m in drawn:
        assert await has_colour_on_map(page, colour, right_m, ahead_m - below_m), what
    await page.screenshot(path=folder / "bow-up.png")
    await page.click("#map-edit")
    await until(page, f"{up} === 'North' && document.querySelector('#map-up').disabled")
    await page.wait_for_timeout(300)
    assert await has_colour_on_map(page, ORANGE, -8.0 - below_m, 7.8), "north is up"
    await page.click("#map-edit")
    await page.click("#map-follow")
    await page.reload()
    await until(page, f"{up} === 'Bow' && document.querySelector('#map-follow').ariaPressed === 'true'")
    await page.click("#map-up")
    await until(page, "document.querySelector('#map-pose').textContent.startsWith('0.0 m E')")
    await page.wait_for_timeout(1000)
    assert await has_colour_on_map(page, ORANGE, -8.0, 7.8)


async def test_the_map_shows_what_the_boat_is_told_and_what_comes(
    browser: Any, open_as: OpenAs, spawn: Spawn, config: Config, tmp_path: Path
) -> None:
    async with spawn("dashboard"), guiding(open_as) as guidance:
        guidance.route = None
        guidance.odometry = replace(guidance.odometry, x_m=0.0, y_m=0.0, yaw_rad=0.0) if guidance.odometry else None
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
        await check_bow_up(page, tmp_path)
        prediction = None
        await page.wait_for_timeout(3600)
        assert not await has_colour_on_map(page, AMBER, 3.0, 0.0), "a way that is no longer said is no longer drawn"
        assert await has_colour_on_map(page, GREEN, -20.0, 1.0)
        publishing.cancel()
        assert watched.errors == []
