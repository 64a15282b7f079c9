"""Where places lie on the map, whichever way is up: the pure geometry, in the engine that runs it."""

from __future__ import annotations

import math
from typing import Any

import pytest

pytestmark = [pytest.mark.browser, pytest.mark.timeout(60)]

EAST_RAD, NORTH_RAD = 0.0, math.pi / 2
PLACES = """async ([centre, pxPerM, upRad, places]) => {
  const { MapProjection } = await import("/static/map_projection.js");
  const map = new MapProjection({ x: centre[0], y: centre[1] }, pxPerM, upRad, 400, 300);
  return places.map(([x, y]) => map.toScreen(x, y).map((px) => Math.round(1e6 * px) / 1e6 + 0));
}"""
ROUND_TRIP = """async ([upRad, dx, dy]) => {
  const { MapProjection } = await import("/static/map_projection.js");
  const before = new MapProjection({ x: 3, y: -7 }, 5, upRad, 400, 300);
  const held = before.toMap(90, 40), after = new MapProjection(before.dragged(dx, dy), 5, upRad, 400, 300);
  const { west, east, south, north } = before.extent, corner = before.toMap(400, 0);
  return [before.toScreen(held.x, held.y), after.toScreen(held.x, held.y),
    west <= corner.x && corner.x <= east && south <= corner.y && corner.y <= north,
    Math.abs((east - west) - (80 * Math.abs(before.cos) + 60 * Math.abs(before.sin))) < 1e-9];
}"""
AHEAD = """async ([upRad, aheadM]) => {
  const { MapProjection, placeAhead } = await import("/static/map_projection.js");
  const map = new MapProjection(placeAhead({ x_m: 3, y_m: -7 }, upRad, aheadM), 2, upRad, 400, 300);
  return map.toScreen(3, -7);
}"""

ELLIPSES = """async ([pose, turnRad]) => {
  const { drawBoat } = await import("/static/map_boat.js");
  const drawn = [], ctx = new OffscreenCanvas(9, 9).getContext("2d");
  ctx.ellipse = (...given) => drawn.push(given);
  drawBoat({ ctx, toScreen: () => [4, 4], turnRad, pxPerM: 10, colour: () => "red" }, pose, "--cyan", true, true);
  return drawn;
}"""


async def test_the_direction_that_is_up_points_up(scripts_page: Any) -> None:
    for what, up_rad, east_px, north_px in (
        ("north", NORTH_RAD, (250, 150), (200, 100)),
        ("the bow of a boat that heads east", EAST_RAD, (200, 100), (150, 150)),
        ("the bow of a boat that heads west", math.pi, (200, 200), (250, 150)),
    ):
        found = await scripts_page.evaluate(PLACES, [[20, 5], 5, up_rad, [[20, 5], [30, 5], [20, 15]]])
        assert [tuple(each) for each in found] == [(200, 150), east_px, north_px], what


async def test_what_is_dragged_stays_under_the_pointer(scripts_page: Any) -> None:
    for up_rad in (NORTH_RAD, 0.3, -2.8):
        held, dragged, has_corner, is_tight = await scripts_page.evaluate(ROUND_TRIP, [up_rad, 33, -12])
        assert held == pytest.approx([90, 40])
        assert dragged == pytest.approx([123, 28])
        assert has_corner
        assert is_tight
        assert await scripts_page.evaluate(AHEAD, [up_rad, 30]) == pytest.approx([200, 210]), (
            "the boat, below the middle"
        )


async def test_the_ellipse_of_the_estimate_lies_as_its_covariance_does(scripts_page: Any) -> None:
    """Of half axes whose root mean square is 5 m, on a map turned by 0.2 rad; a circle where nothing more is known."""
    for ellipse, axes_px, turned_rad in (
        ({"position_major_std_m": 7.0, "position_major_rad": 0.5}, (70.0, 10.0), -0.7),
        ({"position_major_std_m": 5.0, "position_major_rad": 0.0}, (50.0, 50.0), -0.2),
        ({}, (50.0, 50.0), -0.2),
    ):
        pose = {"x_m": 0, "y_m": 0, "yaw_rad": 1.0, "position_std_m": 5.0, **ellipse}
        ((*centre, major_px, minor_px, turned, _, _),) = await scripts_page.evaluate(ELLIPSES, [pose, 0.2])
        assert centre == [0, 0]
        assert (major_px, minor_px) == pytest.approx(axes_px)
        assert turned == pytest.approx(turned_rad)
