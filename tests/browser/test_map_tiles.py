"""The chart below the map: its tiles lie where they belong, come from the page's own server, and say what is wrong."""

from __future__ import annotations

import asyncio
import math
from pathlib import Path
from typing import Any

import aiohttp
import cv2
import numpy as np
import pytest
from msgspec.structs import replace

from paani.config import Config
from tests.browser.guidance import guiding
from tests.browser.test_page import MAP_PX_PER_M, has_colour_on_map, until, watch
from tests.conftest import OpenAs, Spawn

pytestmark = [pytest.mark.browser, pytest.mark.timeout(120)]

LATITUDE_DEG, LONGITUDE_DEG, ZOOM = 47.65, 9.2, 19
GRID = """async ([zooms, latitude, pxPerM, extent, zoom, longitude]) => {
  const { chooseZoom, tileAt, cornerOf, tilesBelow } = await import("/static/tile_grid.js");
  const origin = { latitude_deg: latitude, longitude_deg: longitude };
  return [pxPerM.map((each) => chooseZoom(zooms, latitude, each)), tileAt(...cornerOf(5, 9, zoom), zoom),
    tilesBelow(extent, origin, zoom).map((t) => [t.column, t.row, t.corners.map((c) => [c.x_m, c.y_m])])];
}"""
TILE_BGR, DUSK_RGB = (40, 200, 240), (141, 122, 37)


def tile_at(latitude_deg: float, longitude_deg: float, zoom: int) -> tuple[int, int]:
    """Column and row, by the published formula of Web Mercator tiles."""
    rad = math.radians(latitude_deg)
    column = (longitude_deg + 180.0) / 360.0 * 2**zoom
    row = (1.0 - math.log(math.tan(rad) + 1.0 / math.cos(rad)) / math.pi) / 2.0 * 2**zoom
    return int(column), int(row)


async def test_the_tiles_below_a_part_of_the_map(scripts_page: Any) -> None:
    extent = {"west": -40, "east": 40, "south": -30, "north": 30}
    zooms, corner, tiles = await scripts_page.evaluate(
        GRID, [[10, 15, 18, 19], LATITUDE_DEG, [0.01, 1.0, 3.0, 6.0, 80.0], extent, ZOOM, LONGITUDE_DEG]
    )
    assert zooms == [10, 18, 18, 19, 19], "the coarsest that is fine enough"
    assert corner == pytest.approx([5, 9])
    column, row = tile_at(LATITUDE_DEG, LONGITUDE_DEG, ZOOM)
    by_place = {(x, y): corners for x, y, corners in tiles}
    (west_m, north_m), (east_m, _), (lower_west_m, south_m) = by_place[column, row]
    assert lower_west_m == pytest.approx(west_m)
    assert west_m <= 0 <= east_m
    assert south_m <= 0 <= north_m
    side_m = 2 * math.pi * 6378137 * math.cos(math.radians(LATITUDE_DEG)) / 2**ZOOM
    assert east_m - west_m == pytest.approx(side_m, rel=5e-3)
    assert north_m - south_m == pytest.approx(side_m, rel=5e-3)
    whole = await scripts_page.evaluate(
        GRID, [[19], LATITUDE_DEG, [1.0], {key: 100 * value for key, value in extent.items()}, ZOOM, LONGITUDE_DEG]
    )
    assert whole[2] == [], "too many to draw"


@pytest.mark.rotating(cpu_s=4)
async def test_the_chart_lies_below_the_map(
    browser: Any, open_as: OpenAs, spawn: Spawn, config: Config, tmp_path: Path
) -> None:
    column, row = tile_at(LATITUDE_DEG, LONGITUDE_DEG, ZOOM)
    folder = tmp_path / "tiles"
    picture = await asyncio.to_thread(lambda: cv2.imencode(".png", np.full((256, 256, 3), TILE_BGR, np.uint8))[1])
    for tile_column in range(column - 3, column + 4):
        file = folder / str(ZOOM) / str(tile_column) / f"{row}.png"
        await asyncio.to_thread(file.parent.mkdir, parents=True)
        await asyncio.to_thread(file.write_bytes, picture.tobytes())
    await asyncio.to_thread((folder / "attribution.txt").write_text, "chart of nowhere", encoding="utf-8")
    note = "document.querySelector('#map-tiles').textContent"
    origin = f"http://127.0.0.1:{config.dashboard.port}"
    async with (
        spawn("dashboard", f"dashboard.tiles={folder}"), guiding(open_as) as guidance,
        aiohttp.ClientSession(origin) as client,
    ):  # fmt: skip
        assert guidance.odometry is not None
        guidance.route = None
        guidance.odometry = replace(
            guidance.odometry, x_m=0.0, y_m=0.0, latitude_deg=LATITUDE_DEG, longitude_deg=LONGITUDE_DEG
        )
        watched = await watch(browser, config)
        page = watched.page
        await until(page, f"{note} === 'chart of nowhere'")
        await page.wait_for_timeout(500)
        await page.screenshot(path=tmp_path / "tiles.png")
        assert await has_colour_on_map(page, DUSK_RGB, -12.0, 0.7)
        assert await has_colour_on_map(page, DUSK_RGB, 12.0, 0.7)
        for path, status in (
            (f"{ZOOM}/{column}/{row}", 200), (f"{ZOOM}/{column}/{row - 7}", 204), (f"{ZOOM}/..%2F{column}/{row}", 404),
            (f"{ZOOM}/{column}/-1", 404), (f"2/{column}/1", 404), ("99/0/0", 404), (f"{ZOOM}/{column}/{row}.png", 404),
        ):  # fmt: skip
            async with client.get(f"/tiles/{path}") as answer:
                assert answer.status == status, path
        assert watched.errors == []
        assert watched.foreign_requests == []
        await page.click("#map-up")
        await until(page, "document.querySelector('#map-up-name').textContent === 'Bow'")
        await page.wait_for_timeout(500)
        await page.screenshot(path=tmp_path / "bow-up.png")
        turn_rad = math.pi / 2 - guidance.odometry.yaw_rad
        low_m = 0.22 * await page.evaluate("document.querySelector('#map').clientHeight") / MAP_PX_PER_M
        for east_m, north_m, is_chart in ((20.0, 0.7, True), (-8.0, 0.7, True), (0.7, -12.0, True), (0.7, 20.0, False)):
            right_m = east_m * math.cos(turn_rad) - north_m * math.sin(turn_rad)
            up_m = east_m * math.sin(turn_rad) + north_m * math.cos(turn_rad) - low_m
            assert await has_colour_on_map(page, DUSK_RGB, right_m, up_m) is is_chart, (east_m, north_m)
        await page.click("#map-up")
        await asyncio.to_thread((folder / str(ZOOM) / str(column) / f"{row}.png").write_bytes, b"<html>")
        await page.reload()
        await until(page, f"{note}.includes('{ZOOM}/{column}/{row}.png is no png picture')")
