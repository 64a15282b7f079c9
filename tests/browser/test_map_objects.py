"""The map draws what the boat is told and what it sees coming: fence, station, home, the way ahead, what moves."""

from __future__ import annotations

import asyncio
import math
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from paani import keys
from paani import messages as m
from paani.bus import Bus
from paani.clock import WallClock
from paani.config import Config
from tests.at_work import at_work
from tests.browser.guidance import guiding
from tests.browser.test_legibility import AXE, SERIOUS, SMALL_TARGETS, SMALL_TEXT
from tests.browser.test_page import MAP_PX_PER_M, TRACK_RGB, WAIT_S, has_colour_on_map, until, watch
from tests.conftest import OpenAs, Spawn

pytestmark = [pytest.mark.browser, pytest.mark.timeout(120)]

GREEN, BLUE, RED, AMBER, ORANGE, ROUTE = (
    (77, 184, 133),
    (143, 169, 242),
    (255, 113, 118),
    (227, 179, 65),
    (240, 152, 63),
    (185, 164, 240),
)


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
    rally=points((14.0, -14.0)),
)
SWIMMER = m.MovingObstacle(track_id=4, x_m=-8.0, y_m=8.0, radius_m=1.0, east_mps=0.0, north_mps=-1.0)
CROSSING = m.MovingObstacle(
    track_id=5, x_m=6.0, y_m=-18.0, radius_m=0.5, east_mps=0.0, north_mps=1.0, cpa_m=2.0, cpa_std_m=0.3, tcpa_s=10.0,
    encounter=m.EncounterClass.CROSSING_STARBOARD,
)  # fmt: skip
FREE = (m.Constraint.NONE,) * 3
BLOCKED = (m.Constraint.PERSON, m.Constraint.PERSON, m.Constraint.UNKNOWN_WATER)


def verdict(off_deg: int) -> m.HeadingVerdict:
    """A boat that heads east: what lies to port is refused, and to starboard it is dearer than straight on."""
    heading_rad, off = math.radians(off_deg), abs(off_deg) / 90.0
    if off_deg > 0:
        return m.HeadingVerdict(heading_rad=heading_rad, refused_by=BLOCKED)
    costs = m.HeadingCosts(off, off, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    return m.HeadingVerdict(heading_rad=heading_rad, refused_by=FREE, speed_mps=0.6, costs=costs)


AHEAD = m.Prediction(
    source_us=0, path=points((0, 0), (3, 0), (6, 2)), obstacles=(SWIMMER, CROSSING), home=points((-10, -10)),
    headings=tuple(verdict(off) for off in (0, *(side * step for step in range(20, 180, 20) for side in (1, -1)))),
)  # fmt: skip

NAMES = """async ([places, next, ghost]) => {
  const { drawGhost, drawObstacles } = await import("/static/map_objects.js");
  const { drawRoute } = await import("/static/map_boat.js");
  const { MapLabels } = await import("/static/map_labels.js");
  const labels = new MapLabels(), colour = (name) => ({ "--red": "#f00", "--quiet": "#999" })[name] ?? "#000";
  const ctx = document.createElement("canvas").getContext("2d"), words = [];
  ctx.fillText = (text, x, y) => words.push([text, x, y, ctx.measureText(text).width, ctx.fillStyle]);
  const chart = { ctx, toScreen: (x, y) => [10 * x, 10 * y], pxPerM: 10, turnRad: 0, colour, labels };
  const still = { radius_m: 1, east_mps: 0, north_mps: 0, cpa_m: 2, tcpa_s: 9 };
  const obstacles = places.map(([x_m, y_m, mmsi, is_scanned], index) =>
    ({ ...still, x_m, y_m, mmsi, is_scanned, track_id: index + 1 }));
  const tracks = obstacles.map(({ track_id: id }) => ({ id, label: "buoy" }));
  drawObstacles(chart, obstacles, { x_m: 0, y_m: 0, yaw_rad: 0, surge_mps: 0 }, 0, tracks);
  if (next) drawRoute(chart, { waypoints: [{ x_m: next[0], y_m: next[1] }] }, 0, 1);
  if (ghost) drawGhost(chart, { x_m: ghost[0], y_m: ghost[1], yaw_rad: 0, surge_mps: 0 }, 12);
  labels.draw(ctx, colour);
  return words;
}"""


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
        try:
            async with asyncio.timeout(WAIT_S):  # a pose that a busy machine has let go stale is drawn faintly
                while not await has_colour_on_map(page, colour, right_m, ahead_m - below_m):
                    await asyncio.sleep(0.1)
        except TimeoutError:
            pytest.fail(what)
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


async def check_headings(page: Any, folder: Path) -> None:
    """Rays around the boat and the words of one of them: the one taken, by the pointer, by a tap, by keys."""
    words = "document.querySelector('#heading-words').textContent"
    assert not await page.is_visible("#headings")
    await page.click("#map-headings")
    await until(page, f"{words}.startsWith('090° taken, costs 0.00')")
    await page.wait_for_timeout(300)
    ray_m = 47 / MAP_PX_PER_M  # the middle of the cell of the second speed
    for colour, east_m, north_m in ((RED, 0.0, ray_m), (GREEN, 0.0, -ray_m), (GREEN, ray_m, 0.0)):
        # at 80, 100 and 0 degrees to port
        turn_rad = 0.0 if east_m else math.radians(-10)
        place = math.cos(turn_rad) * east_m - math.sin(turn_rad) * north_m, math.cos(turn_rad) * north_m
        assert await has_colour_on_map(page, colour, *place), (colour, place)
    lowest_m = 33 / MAP_PX_PER_M
    place = -math.sin(math.radians(-10)) * lowest_m, math.cos(math.radians(-10)) * lowest_m
    assert await has_colour_on_map(page, BLUE, *place), "the lowest speed is innermost"
    box = await page.locator("#map").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    await page.mouse.move(x + 5, y - 40)
    await until(page, f"{words}.startsWith('010° refused: at the highest speed: too near to a person')")
    await page.mouse.click(x + 40, y + 15)
    await page.mouse.move(x + 150, y)
    await until(page, f"{words}.startsWith('110° free, dearer by 0.44: off the course +0.22')")
    await page.focus("#heading-range")
    await page.keyboard.press("ArrowRight")
    await until(page, f"{words}.startsWith('130° free')")
    assert await page.get_attribute("#heading-range", "aria-valuetext") == "130° free"
    await page.screenshot(path=folder / "headings.png")
    await page.evaluate(AXE.read_text(encoding="utf-8"))
    for palette in ("day", "night"):
        while await page.evaluate("document.documentElement.dataset.palette") != palette:
            await page.keyboard.press("d")
        await page.set_viewport_size({"width": 360, "height": 740})
        await page.locator("#heading-words").scroll_into_view_if_needed()
        await page.wait_for_timeout(300)
        await page.screenshot(path=folder / f"headings-{palette}.png", full_page=True)
        assert await page.evaluate(SERIOUS) == [], palette
        assert await page.evaluate(SMALL_TEXT) == []
        assert await page.evaluate(SMALL_TARGETS, 44) == []
        assert await page.evaluate("document.documentElement.scrollWidth") == 360
    await page.set_viewport_size({"width": 1440, "height": 900})
    await page.keyboard.press("d")
    await page.click("#heading-taken")
    await until(page, f"{words}.startsWith('090° taken')")
    await page.click("#map-headings")


@pytest.mark.rotating(cpu_s=7)
async def test_the_map_shows_what_the_boat_is_told_and_what_comes(
    browser: Any, open_as: OpenAs, spawn: Spawn, config: Config, tmp_path: Path
) -> None:
    prediction: m.Prediction | None = AHEAD

    async def publish_forever(navigator: Bus) -> None:
        missions, predictions = navigator.publisher(keys.MISSION), navigator.publisher(keys.PREDICTION)
        while True:
            now_us = WallClock().now_us()
            missions.put(replace(MISSION, source_us=now_us))
            if prediction is not None:
                predictions.put(replace(prediction, source_us=now_us))
            await asyncio.sleep(0.2)

    async with spawn("dashboard"), guiding(open_as) as guidance, at_work(publish_forever(guidance.navigator)):
        guidance.route = None
        guidance.odometry = replace(guidance.odometry, x_m=0.0, y_m=0.0, yaw_rad=0.0) if guidance.odometry else None
        watched = await watch(browser, config)
        page = watched.page
        await until(page, "document.querySelector('#map-pose').textContent.startsWith('0.0 m E, 0.0 m N')")
        await page.wait_for_timeout(1000)
        await page.screenshot(path=tmp_path / "map.png")
        drawn = [
            ("the fence to stay in", GREEN, -20.0, 1.0), ("the fence to stay out of", RED, 10.0, 8.0),
            ("the station", ROUTE, 3.0, -12.0), ("home", ROUTE, -10.0, -8.67), ("the way ahead", AMBER, 3.0, 0.0),
            ("the swimmer", ORANGE, -8.0, 7.8), ("where they will be", ORANGE, -8.0, 4.5),
            ("where the other one will be nearest", AMBER, 6.0, -8.0), ("and the boat then", AMBER, 5.0, 0.0),
        ]  # fmt: skip
        for what, colour, east_m, north_m in drawn:
            assert await has_colour_on_map(page, colour, east_m, north_m), what
        assert not await has_colour_on_map(page, RED, 8.0, 8.0)
        await check_headings(page, tmp_path)
        await check_bow_up(page, tmp_path)
        prediction = None
        await page.wait_for_timeout(3600)
        assert not await has_colour_on_map(page, AMBER, 3.0, 0.0), "a way that is no longer said is no longer drawn"
        assert await has_colour_on_map(page, GREEN, -20.0, 1.0)
        assert watched.errors == []


async def test_the_names_of_obstacles_beside_each_other_lie_on_none_of_the_others(scripts_page: Any) -> None:
    places = [[20.0, 10.0], [20.4, 10.2], [20.1, 10.1], [60.0, 10.0], [90.0, 10.0, 235000001], [120.0, 10.0, 0, True]]
    words = await scripts_page.evaluate(NAMES, [places, None, None])
    assert sorted(text for text, *_ in words if "#" in text) == ["buoy #1", "buoy #2", "buoy #3", "buoy #4"]
    assert len(words) == 12, "each with how near it comes"
    assert {"AIS 235000001", "lidar"} < {text for text, *_ in words}
    assert overlaps(words) == []
    assert ("buoy #4", 104.0) in [(text, y) for text, _, y, *_ in words], "what stands alone keeps its place"


async def test_the_boat_that_is_not_heard_of_leaves_the_next_waypoint_legible(scripts_page: Any) -> None:
    """And the name of what swims there."""
    for below_m in (0.0, 0.6, 1.2, 1.7, 2.4):
        words = await scripts_page.evaluate(NAMES, [[[20.2, 10.3]], [20.0, 10.0], [20.0, 10.0 + below_m]])
        colours = {text: colour for text, *_, colour in words}
        assert set(colours) == {"next 1", "not heard for 12 s", "buoy #1", "nearest 2.0 m in 9 s"}
        assert (colours["next 1"], colours["not heard for 12 s"]) == ("#999999", "#ff0000")
        assert overlaps(words) == []


def overlaps(words: list[tuple[str, float, float, float, str]]) -> list[tuple[str, str]]:
    """Words that lie on each other, of lines 12 px high."""
    return [
        (text, other)
        for index, (text, x, y, width, _) in enumerate(words)
        for other, other_x, other_y, other_width, _ in words[:index]
        if x < other_x + other_width and other_x < x + width and abs(y - other_y) < 12
    ]
