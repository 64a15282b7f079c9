"""Missions drawn on the map: points, undo, faults at their places, files in and out, one request that is answered."""

from __future__ import annotations

import asyncio
import json
import random
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from paani import keys
from paani import messages as m
from paani.config import Config
from paani.fence_geometry import is_allowed
from paani.geometry import geodetic_from_enu
from paani.map_origin import map_origin_deg
from paani_services.navigator.files.geojson import read_geojson_line
from paani_services.navigator.files.gpx import read_gpx
from paani_services.navigator.files.map_frame import MapFrame
from tests.at_work import at_work
from tests.browser.guidance import guiding, repeat
from tests.browser.test_legibility import AXE, SERIOUS, SMALL_TARGETS, SMALL_TEXT
from tests.browser.test_map_objects import MISSION
from tests.browser.test_page import MAP_PX_PER_M, WAIT_S, has_colour_on_map, until, watch
from tests.conftest import OpenAs, Spawn

pytestmark = [pytest.mark.browser, pytest.mark.timeout(120)]

ISLAND = ((6.0, 0.0), (10.0, 0.0), (10.0, 8.0), (6.0, 8.0))
LAND_RGB = (147, 130, 90)
HERE = {"x_m": 0.0, "y_m": 0.0, "latitude_deg": 47.65, "longitude_deg": 9.2}
JUDGE = """async ([fence, points]) => {
  const { isAllowed } = await import("/static/plane_geometry.js");
  return points.map(([x_m, y_m]) => isAllowed(fence, { x_m, y_m }));
}"""
MARKS = """async ([legs, fence, turnRadiusM, points = []]) => {
  const { findMarks } = await import("/static/mission_checks.js");
  const { rallyOf } = await import("/static/mission_files.js");
  return findMarks({ legs, fence, rally: rallyOf(points) }, { marginM: 1.5, turnRadiusM }).map((mark) => mark.text);
}"""
COUNTED = """async ([waypointCount, cornerCount]) => {
  const { findMarks } = await import("/static/mission_checks.js");
  const waypoints = Array.from({ length: waypointCount }, (_, i) => ({ x_m: 100 + i, y_m: 0 }));
  const star = Array.from({ length: cornerCount }, (_, i) => ({ x_m: 9 * Math.cos(2 * i), y_m: 9 * Math.sin(2 * i) }));
  const legs = [{ kind: "return_home", waypoints, repeat: false, laps: 1 }], fence = [{ keep: "out", corners: star }];
  const before = performance.now(), marks = findMarks({ legs, fence, rally: [] }, { marginM: 1.5, turnRadiusM: 0 });
  return [marks.map((mark) => mark.text), performance.now() - before];
}"""
DROP = """([name, text]) => {
  const dataTransfer = new DataTransfer();
  dataTransfer.items.add(new File([text], name));
  document.querySelector("#map").dispatchEvent(new DragEvent("drop", { dataTransfer, cancelable: true }));
}"""


SETTLED = """new Promise((resolve) => {
  const canvas = document.querySelector("#map"), ctx = canvas.getContext("2d"), { clearRect } = ctx;
  const layout = () => JSON.stringify(canvas.getBoundingClientRect());
  let before = "", same = 0;
  ctx.clearRect = function (...box) {
    clearRect.apply(this, box);
    const now = layout();
    same = now === before ? same + 1 : 0;
    before = now;
    if (same < 2) return;
    delete ctx.clearRect;
    resolve();
  };
})"""
UNDRAWN = """(style) => {
  for (let timer = 0; timer < 10000; timer++) clearInterval(timer);
  Object.assign(document.querySelector("#map").style, style);
}"""


class Editor:
    """The editor in the page, by pressing and dragging at places of the map [m]."""

    def __init__(self, page: Any) -> None:
        self.page = page

    async def pixel(self, east_m: float, north_m: float) -> tuple[float, float]:
        """Where a place lies once the map is drawn again and stays where it is: a fault that is said moves it."""
        await self.page.evaluate(SETTLED)
        box = await self.page.locator("#map").bounding_box()
        x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        return x + MAP_PX_PER_M * east_m, y - MAP_PX_PER_M * north_m

    async def press(self, *places: tuple[float, float]) -> None:
        for place in places:
            await self.page.mouse.click(*await self.pixel(*place))

    async def drag(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        await self.page.mouse.move(*await self.pixel(*start))
        await self.page.mouse.down()
        await self.page.mouse.move(*await self.pixel(*end), steps=3)
        await self.page.mouse.up()

    async def choose(self, text: str) -> None:
        await self.page.click(f"#editor button:text-is('{text}')")

    async def points(self) -> list[tuple[float, float]]:
        plan = await self.page.evaluate("paani.plan")
        return [(round(point["x_m"], 1), round(point["y_m"], 1)) for point in plan["legs"][0]["waypoints"]]

    async def until_note(self, text: str) -> None:
        try:
            await until(self.page, f"document.querySelector('#editor-note').textContent.includes({json.dumps(text)})")
        except TimeoutError:
            pytest.fail(f"not {text!r} but {await self.page.inner_text('#editor-note')!r}")


async def test_what_is_too_much_is_said_at_once_and_nothing_else_is_looked_at(scripts_page: Any) -> None:
    for size, marks in (
        ((10_000, 100), ["keep-out area 1: its edges cross"]),
        ((10_000, 101), ["10000 waypoints times 101 corners is more than 1000000"]),
        ((10_001, 3), ["more than 10000 waypoints"]),
        ((999, 1001), ["more than 1000 corners"]),
    ):
        assert (await scripts_page.evaluate(COUNTED, list(size)))[0] == marks


async def test_a_point_is_drawn_where_the_hand_went_down_on_what_is_seen(
    browser: Any, open_as: OpenAs, spawn: Spawn, config: Config
) -> None:
    async with spawn("dashboard"), guiding(open_as) as guidance:
        assert guidance.odometry is not None
        guidance.odometry = replace(guidance.odometry, **HERE)
        page = (await watch(browser, config)).page
        await until(page, "document.querySelector('#map-pose').textContent.startsWith('0.0 m E, 0.0 m N')")
        editor = Editor(page)
        await page.click("#map-edit")
        await editor.pixel(0, 0)
        await page.evaluate(UNDRAWN, {"height": "50%"})  # laid out anew and not drawn again: the picture is stretched
        box = await page.locator("#map").bounding_box()
        x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        await page.mouse.click(x, y)
        assert await editor.points() == [(0, 0)]
        await page.mouse.move(x + 120, y)
        await page.mouse.down()
        await page.evaluate(UNDRAWN, {"height": "80%"})
        await page.mouse.up()
        assert await editor.points() == [(0, 0), (20, 0)]


async def test_land_is_drawn_marked_at_its_place_and_refused_when_it_is_sent(
    browser: Any, open_as: OpenAs, spawn: Spawn, config: Config, tmp_path: Path
) -> None:
    """The page and the boat's own processes judge the same file."""
    places = [geodetic_from_enu(x, y, HERE["latitude_deg"], HERE["longitude_deg"]) for x, y in ISLAND]
    ring = [[longitude_deg, latitude_deg] for latitude_deg, longitude_deg in (*places, places[0])]
    land = tmp_path / "land.geojson"
    land.write_text(json.dumps({"type": "Polygon", "coordinates": [ring]}))
    origin = f"localization.origin_lat_lon_deg=[{HERE['latitude_deg']}, {HERE['longitude_deg']}]"
    poses = (await open_as("localization")).publisher(keys.ODOMETRY)
    pose = replace(m.Odometry(source_us=0, x_m=0.0, y_m=0.0, yaw_rad=0.3, surge_mps=0.0, healthy=True), **HERE)
    async with (
        spawn("operator"),
        spawn("navigator", f"navigator.land={land}", origin),
        spawn("dashboard"),
        at_work(repeat(poses, pose, 0.1)),
    ):
        watched = await watch(browser, config)
        page, editor = watched.page, Editor(watched.page)
        await until(page, "document.querySelector('#map-pose').textContent.startsWith('0.0 m E, 0.0 m N')")
        await until(page, "!document.querySelector('#map-land').hidden")
        assert await page.inner_text("#map-land") == "land"
        await page.click("#map-edit")
        await editor.pixel(0, 0)
        assert await has_colour_on_map(page, LAND_RGB, 6.0, 2.0)
        await editor.press((-12, 4), (16, 4))
        await editor.until_note("leg 1, waypoint 1: crosses land")
        (mark,) = await page.evaluate("paani.marks")
        assert 5.5 <= mark["at"]["x_m"] <= 6.5, "at the shore"
        await page.wait_for_timeout(300)
        await page.screenshot(path=tmp_path / "land.png")
        await page.click("#editor-send")
        await editor.until_note("not accepted: legs[0].waypoints[0]: the leg to the next crosses land")
        await editor.drag((-12, 4), (-12, -3))
        await editor.drag((16, 4), (16, -1))
        await editor.until_note("leg 1, waypoint 1: nearer than 1.5 m to land")
        await page.click("#editor-send")
        await editor.until_note("the leg to the next comes nearer than 1.5 m to land")
        await editor.drag((16, -1), (16, -12))
        await editor.until_note("Nothing is wrong")
        await page.click("#editor-send")
        await editor.until_note("Accepted")
        await until(page, "!document.querySelector('#map-land').hidden")
        assert [line for line in watched.errors if "409" not in line] == []


@pytest.mark.rotating(cpu_s=6)
async def test_a_mission_is_drawn_checked_and_sent_as_one(
    browser: Any, open_as: OpenAs, spawn: Spawn, config: Config, tmp_path: Path
) -> None:
    accepted = (await open_as("observer")).latest(keys.ORDERED_MISSION)
    async with (
        spawn("operator"),
        spawn("dashboard"),
        guiding(open_as) as guidance,
        at_work(repeat(guidance.navigator.publisher(keys.MISSION), MISSION, 0.5)),
    ):
        guidance.route = None
        assert guidance.odometry is not None
        pose = guidance.odometry = replace(guidance.odometry, **HERE)
        watched = await watch(browser, config)
        page, editor = watched.page, Editor(watched.page)
        await until(page, "document.querySelector('#map-pose').textContent.startsWith('0.0 m E, 0.0 m N')")

        await page.click("#map-edit")
        await page.screenshot(path=tmp_path / "begin.png")
        await editor.press((-10, 0), (0, 9), (8, 0))
        assert await editor.points() == [(-10, 0), (0, 9), (8, 0)]
        await editor.until_note("Nothing is wrong")
        await editor.drag((8, 0), (8, -8))
        await editor.drag((-5, 4.5), (-9, 9))
        assert await editor.points() == [(-10, 0), (-9, 9), (0, 9), (8, -8)], "a line that is dragged gets a point"
        await editor.choose("Delete point")
        assert await editor.points() == [(-10, 0), (0, 9), (8, -8)]
        for _ in range(3):
            await editor.choose("Undo")
        assert await editor.points() == [(-10, 0), (0, 9), (8, 0)]

        async with asyncio.timeout(WAIT_S):
            while len((await page.evaluate("paani.plan"))["fence"]) != 2:  # until the mission has come to the page
                await editor.choose("In force")
        await editor.choose("Delete leg")
        await editor.choose("+ Route")
        await editor.press((-10, -8), (0, 9), (18, 9))
        await editor.until_note("waypoint 2: leaves the fence")
        marks = await page.evaluate("paani.marks")
        assert 9.5 <= marks[0]["at"]["x_m"] <= 10.6, "at the place"
        await page.wait_for_timeout(300)
        await page.screenshot(path=tmp_path / "faults.png")
        await page.click("#editor-send")
        await editor.until_note("not accepted: legs[0].waypoints[1]: the leg to the next leaves the fence")
        await editor.drag((18, 9), (6, -8))
        await editor.until_note("Nothing is wrong")
        await editor.choose("+ Hold")
        await editor.press((0, -14))
        await editor.choose("+ Return")
        await editor.choose("+ Rally")
        await editor.press((-14, -14))  # beside the one in force
        await page.click("#editor-send")
        await editor.until_note("Accepted")
        async with asyncio.timeout(5.0):
            while accepted.value is None or not accepted.value.legs:
                await accepted.next()
        assert [leg.kind for leg in accepted.value.legs] == [
            m.LegKind.FOLLOW_ROUTE,
            m.LegKind.HOLD_STATION,
            m.LegKind.RETURN_HOME,
        ]
        drawn = [(point.x_m, point.y_m) for point in accepted.value.legs[0].waypoints]
        assert await editor.points() == [(round(x_m, 1), round(y_m, 1)) for x_m, y_m in drawn]
        assert len(accepted.value.fence) == 2
        assert [(round(point.x_m), round(point.y_m)) for point in accepted.value.rally] == [(14, -14), (-14, -14)]
        await page.wait_for_timeout(300)
        await page.screenshot(path=tmp_path / "accepted.png")
        axe = await asyncio.to_thread(AXE.read_text, encoding="utf-8")
        await page.evaluate(axe)
        assert await page.evaluate(SERIOUS) == []
        assert await page.evaluate(SMALL_TEXT) == []
        assert await page.evaluate(SMALL_TARGETS, 24) == []
        await page.set_viewport_size({"width": 390, "height": 844})
        await page.wait_for_timeout(300)
        await page.evaluate("document.querySelector('.panel.map').scrollIntoView()")
        await page.screenshot(path=tmp_path / "phone.png")
        assert await page.evaluate("document.documentElement.scrollWidth") == 390
        assert await page.evaluate(SMALL_TARGETS, 44) == []
        await page.set_viewport_size({"width": 1440, "height": 900})

        frame = MapFrame("", None, map_origin_deg(pose))
        for kind, read in (("GPX", read_gpx), ("GeoJSON", read_geojson_line)):
            async with page.expect_download() as found:
                await editor.choose(f"{kind} ↓")
            path = tmp_path / f"mission.{kind.lower()}"
            await (await found.value).save_as(path)
            line = await asyncio.to_thread(read, path, str(path))
            for point, (x_m, y_m) in zip(line.points, drawn, strict=True):
                waypoint = frame.waypoint_of(point, "point")
                assert (waypoint.x_m, waypoint.y_m) == pytest.approx((x_m, y_m), abs=0.01)
            await editor.choose("+ Stop")
            if kind == "GPX":
                await page.set_input_files("#editor-file", str(path))
            else:
                text = await asyncio.to_thread(path.read_text, encoding="utf-8")
                await page.evaluate(DROP, [path.name, text])
            await until(page, "paani.plan.legs.length === 1")
            assert await page.evaluate("paani.plan.rally[0].waypoints.length") == 2
            assert await editor.points() == [(round(x_m, 1), round(y_m, 1)) for x_m, y_m in drawn]
        assert [line for line in watched.errors if "409" not in line] == []
        for name, text, why in (
            ("a.gpx", "<gpx", "is no GPX file"),
            ("a.gpx", '<!DOCTYPE x [<!ENTITY a "b">]><gpx/>', "DOCTYPE"),
            ("a.gpx", '<gpx><wpt lat="91" lon="0"/></gpx>', "no place on Earth"),
            ("a.geojson", "{}", "no route and no area"),
        ):
            await page.evaluate(DROP, [name, text])
            await editor.until_note(why)

        fence = [{"keep": a.keep, "corners": [{"x_m": c.x_m, "y_m": c.y_m} for c in a.corners]} for a in MISSION.fence]
        source = random.Random(7)
        points = [(source.uniform(-25, 25), source.uniform(-25, 25)) for _ in range(300)]
        assert await page.evaluate(JUDGE, [fence, points]) == [is_allowed(MISSION.fence, point) for point in points]
        zigzag = {"kind": "follow_route", "repeat": False, "laps": 1, "waypoints": [
            {"x_m": 0, "y_m": 0}, {"x_m": 3, "y_m": 0}, {"x_m": 0, "y_m": 1}]}  # fmt: skip
        assert await page.evaluate(MARKS, [[zigzag], [], 2.2]) == [
            "leg 1, waypoint 2: a turn too tight for the hull, 2.2 m"
        ]
        assert await page.evaluate(MARKS, [[zigzag], [], 0]) == []
        assert await page.evaluate(MARKS, [[], fence, 0, [{"x_m": 0, "y_m": 0}, {"x_m": 13, "y_m": 8}]]) == [
            "rally points, waypoint 2: leaves the fence"
        ]
        far = [{"x_m": 0, "y_m": 0}] * 21
        assert await page.evaluate(MARKS, [[], [], 0, far]) == ["more than 20 rally points"]
        bow = [{"x_m": x, "y_m": y} for x, y in ((0, 0), (9, 9), (9, 0), (0, 9))]
        assert await page.evaluate(MARKS, [[], [{"keep": "in", "corners": bow}], 0]) == [
            "keep-in area 1: its edges cross"
        ]
