"""Where the boat may be: the plane geometry, the braking, and what a file may say."""

from __future__ import annotations

import math
from pathlib import Path

import msgspec
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from paani.config import load_config
from paani.errors import UserError
from paani.fence_geometry import (
    allowed_distance_m,
    distance_to_edge_m,
    find_route_violation,
    is_allowed,
    return_bearing_rad,
)
from paani.messages import Direction, FenceArea, Inhibit, Keep, Odometry, Route, Waypoint
from paani.missions import mission_of_route
from paani_services.navigator.avoidance.fence import limit_speed
from paani_services.navigator.files.fence_file import load_fence
from tests.unit.paani_services.navigator.drifting_boat import DriftingBoat

PAANI = load_config().navigator
RETURNING = msgspec.structs.replace(PAANI, fence_return=True)


def area(keep: Keep, *corners: tuple[float, float]) -> FenceArea:
    return FenceArea(keep=keep, corners=tuple(Waypoint(x_m=x, y_m=y) for x, y in corners))


def box(keep: Keep, x1: float, y1: float, x2: float, y2: float) -> FenceArea:
    return area(keep, (x1, y1), (x2, y1), (x2, y2), (x1, y2))


BASIN = box(Keep.IN, 0, 0, 40, 20)
ISLAND = box(Keep.OUT, 10, 8, 14, 12)
FENCE = (BASIN, ISLAND)


def at(x_m: float, y_m: float, yaw_rad: float = 0.0, surge_mps: float = 0.0, sway_mps: float = 0.0) -> Odometry:
    return Odometry(
        source_us=0, x_m=x_m, y_m=y_m, yaw_rad=yaw_rad, surge_mps=surge_mps, sway_mps=sway_mps, healthy=True
    )


def straight_to(*points: tuple[float, float]) -> Route:
    return Route(source_us=0, name="r", waypoints=tuple(Waypoint(x_m=x, y_m=y) for x, y in points), repeat=False)


@pytest.mark.parametrize(
    ("point", "allowed"),
    [((5, 5), True), ((12, 10), False), ((-1, 5), False), ((41, 5), False), ((10, 10), False), ((9.9, 10), True)],
)
def test_inside_keep_in_and_outside_keep_out(point: tuple[float, float], allowed: bool) -> None:
    assert is_allowed(FENCE, point) is allowed
    assert is_allowed((), point)


def test_areas_that_keep_in_join() -> None:
    """The boat may cross from one area into the other, because the edge between them is no border."""
    joined = (box(Keep.IN, 0, 0, 20, 20), box(Keep.IN, 18, 0, 40, 20))
    assert allowed_distance_m(joined, (5, 10), (35, 10)) == math.inf
    assert find_route_violation(joined, straight_to((5, 10), (35, 10)).waypoints, 2.0) is None
    apart = (box(Keep.IN, 0, 0, 20, 20), box(Keep.IN, 25, 0, 40, 20))
    assert allowed_distance_m(apart, (5, 10), (35, 10)) == pytest.approx(15.0)


@given(
    st.lists(st.tuples(st.floats(2.0, 9.0), st.floats(0.2, 1.0)), min_size=3, max_size=12),
    st.tuples(st.floats(-12, 12), st.floats(-12, 12)),
    st.tuples(st.floats(-12, 12), st.floats(-12, 12)),
    st.sampled_from(Keep),
)
@example([(3.0, 0.2), (2.0, 0.5), (2.0, 0.5), (2.0, 0.5)], (2.0, 0.0), (0.0, 0.0), Keep.OUT)  # from a corner inwards
@settings(max_examples=60, deadline=None)
@pytest.mark.slow
def test_allowed_distance_agrees_with_probing_along_the_line(
    spokes: list[tuple[float, float]], start: tuple[float, float], end: tuple[float, float], keep: Keep
) -> None:
    """For any star-shaped area every point before the distance is allowed, and just beyond it one is not."""
    turns = np.cumsum([share for _, share in spokes]) / sum(share for _, share in spokes) * 2.0 * math.pi
    star = area(keep, *((r * math.cos(a), r * math.sin(a)) for (r, _), a in zip(spokes, turns.tolist(), strict=True)))
    fence, length_m = (star,), math.dist(start, end)
    room = allowed_distance_m(fence, start, end)

    def after(travelled_m: float) -> tuple[float, float]:
        part = travelled_m / length_m if length_m else 0.0
        return start[0] + part * (end[0] - start[0]), start[1] + part * (end[1] - start[1])

    assert is_allowed(fence, start) or room == 0.0
    for travelled_m in np.linspace(0.0, min(room, length_m), 16)[:-1].tolist() if room > 0.0 else ():
        assert is_allowed(fence, after(travelled_m)) or distance_to_edge_m(fence, after(travelled_m)) < 1e-6
    if 0.0 < room < length_m - 1e-3:
        assert any(not is_allowed(fence, after(room + beyond)) for beyond in (1e-9, 1e-6, 1e-4)) or (
            distance_to_edge_m(fence, after(room)) < 1e-6
        )


def test_speed_falls_towards_the_edge_and_ends_before_it() -> None:
    """Margin and stopping distance always fit: 0.7 m/s at 5 m from the edge, 0.3 m/s at 3 m, none at 1.6 m."""
    speeds = [limit_speed(FENCE, at(x_m, 4.0), 0.0, 0.6, PAANI) for x_m in (20.0, 35.0, 37.0, 38.4)]
    assert speeds == [0.6, 0.6, pytest.approx(0.3), None]
    assert limit_speed(FENCE, at(38.4, 4.0), math.pi, 0.6, PAANI) == 0.6


def test_velocity_over_ground_counts_not_the_heading() -> None:
    """A boat carried towards the edge while it heads along it gets no thrust, whatever is ordered."""
    carried = at(20.0, 17.5, 0.0, surge_mps=0.1, sway_mps=0.6)
    assert limit_speed(FENCE, carried, 0.0, 0.6, PAANI) is None
    assert limit_speed(FENCE, at(20.0, 17.5, 0.0, surge_mps=0.6), 0.0, 0.6, PAANI) == 0.6


@given(st.floats(1.0, 39.0), st.floats(0.0, 0.6), st.floats(0.05, 0.6))
def test_an_edge_astern_is_kept_off_as_one_ahead(x_m: float, way_mps: float, speed_mps: float) -> None:
    bow_first = limit_speed(FENCE, at(x_m, 4.0, math.pi, way_mps), math.pi, speed_mps, PAANI)
    stern_first = limit_speed(FENCE, at(x_m, 4.0, 0.0, -way_mps), math.pi, speed_mps, PAANI, is_astern=True)
    assert stern_first == (None if bow_first is None else pytest.approx(bow_first, abs=1e-9))


@pytest.mark.parametrize("is_astern", [False, True])
@pytest.mark.parametrize("noise_mps", [0.04, 0.099])
@pytest.mark.slow
def test_noise_away_from_the_edge_is_no_way_off_it(noise_mps: float, *, is_astern: bool) -> None:
    """Too slow for a course: nearer the edge it counts, farther from it does not."""
    sense = -1.0 if is_astern else 1.0
    edges = (0.1, 4.0, -1.0) if is_astern else (39.9, 4.0, 1.0)
    allowed = []
    for way_mps in (-noise_mps, 0.0, noise_mps):
        places = (at(edges[0] - edges[2] * step * 0.02, 4.0, 0.0, sense * way_mps) for step in range(60))
        orders = [limit_speed(FENCE, place, math.pi / 2.0, 0.3, PAANI, is_astern=is_astern) for place in places]
        allowed.append(sum(order is not None for order in orders))
    assert allowed[0] == allowed[1] > allowed[2] > 0


def test_outside_nothing_moves_unless_fence_return_is_set() -> None:
    outside = at(42.0, 10.0)
    for heading_rad in (math.pi, 0.0, 2.0):
        assert limit_speed(FENCE, outside, heading_rad, 0.6, PAANI) is None
    assert return_bearing_rad(FENCE, (42.0, 10.0)) == pytest.approx(math.pi)
    assert limit_speed(FENCE, outside, math.radians(140.0), 0.6, RETURNING) == 0.6
    for heading_rad in (0.0, math.radians(100.0), math.radians(-115.0)):
        assert limit_speed(FENCE, outside, heading_rad, 0.6, RETURNING) is None
    assert return_bearing_rad(FENCE, (12.0, 9.0)) == pytest.approx(-math.pi / 2)


@given(
    yaw_deg=st.floats(-180, 180),
    x_m=st.floats(4, 36),
    y_m=st.floats(3, 17),
    advice=st.lists(
        st.sampled_from([Direction.STRAIGHT, Direction.LEFT, Direction.RIGHT, Direction.SLIGHT_LEFT]),
        min_size=1,
        max_size=3,
    ),
)
@example(yaw_deg=53.0, x_m=4.0, y_m=14.0, advice=[Direction.LEFT, Direction.LEFT, Direction.STRAIGHT])
@example(yaw_deg=-121.0, x_m=16.0, y_m=12.75, advice=[Direction.LEFT, Direction.RIGHT])  # close by a corner, turning
@settings(max_examples=8, deadline=None)
@pytest.mark.slow
def test_no_advice_carries_the_boat_over_the_edge(
    yaw_deg: float, x_m: float, y_m: float, advice: list[Direction]
) -> None:
    """Whatever is advised, the boat stays inside, though its route leads out."""
    if not is_allowed(FENCE, (x_m, y_m)):
        return
    mission = msgspec.structs.replace(mission_of_route(straight_to((x_m, y_m), (80.0, 30.0))), fence=FENCE)
    boat = DriftingBoat(mission, PAANI, (x_m, y_m), math.radians(yaw_deg))
    for direction in (*advice, Direction.STRAIGHT):
        boat.direction = direction
        for _ in boat.run(8.0):
            assert is_allowed(FENCE, boat.position_m)


@pytest.mark.slow
def test_the_boat_stops_before_the_edge_and_says_why() -> None:
    mission = msgspec.structs.replace(mission_of_route(straight_to((5, 4), (80, 4))), fence=FENCE)
    boat = DriftingBoat(mission, PAANI, (5.0, 4.0))
    order = boat.settle(120.0)
    assert order.inhibits == (Inhibit.OUTSIDE_FENCE,)
    assert 37.0 < boat.x_m < 40.0 - 0.5 * PAANI.fence_margin_m
    assert boat.speed_mps < 0.01


@pytest.mark.slow
def test_the_boat_stops_before_land_as_before_a_fence() -> None:
    shore = box(Keep.OUT, 40, -30, 50, 30)
    mission = msgspec.structs.replace(mission_of_route(straight_to((5, 4), (80, 4))), land=(shore,))
    boat = DriftingBoat(mission, PAANI, (30.0, 4.0))
    assert boat.settle(60.0).inhibits == (Inhibit.OUTSIDE_FENCE,)
    assert 37.0 < boat.x_m < 40.0 - 0.5 * PAANI.fence_margin_m
    aground = DriftingBoat(mission, PAANI, (44.0, 4.0))
    assert aground.settle(5.0).inhibits == (Inhibit.OUTSIDE_FENCE,)


@pytest.mark.slow
def test_a_boat_pushed_out_stays_still_or_comes_back() -> None:
    mission = msgspec.structs.replace(mission_of_route(straight_to((5, 4), (30, 4))), fence=FENCE)
    still = DriftingBoat(mission, PAANI, (44.0, 4.0))
    assert still.settle(60.0).inhibits == (Inhibit.OUTSIDE_FENCE,)
    assert still.x_m == 44.0
    back = DriftingBoat(mission, RETURNING, (44.0, 4.0))
    back.settle(60.0)
    assert is_allowed(FENCE, back.position_m)


@pytest.mark.parametrize(
    ("points", "index", "what"),
    [
        (((5, 4), (30, 4), (50, 4)), 2, "outside"),
        (((5, 4), (12, 10)), 1, "outside"),
        (((5, 4), (5, 10), (30, 10)), 1, "leaves"),
        (((5, 4), (39, 4)), 1, "nearer than 1.5 m"),
        (((5, 7), (30, 7)), 0, "nearer than 1.5 m"),
    ],
)
def test_a_route_that_leaves_the_fence_is_named_by_its_waypoint(
    points: tuple[tuple[float, float], ...], index: int, what: str
) -> None:
    found = find_route_violation(FENCE, straight_to(*points).waypoints, 1.5)
    assert found is not None
    assert found[0] == index
    assert what in found[1]


TOML = """
[origin]
latitude_deg = 47.65
longitude_deg = 9.48

[[areas]]
name = "basin"
keep = "in"
corners = [{x_m = 0, y_m = 0}, {x_m = 40, y_m = 0}, {x_m = 40, y_m = 20}, {x_m = 0, y_m = 20}]

[[areas]]
keep = "out"
corners = [{x_m = 10, y_m = 8}, {x_m = 14, y_m = 8}, {x_m = 14, y_m = 12}, {x_m = 10, y_m = 12}]
"""
GEOJSON = """{"type": "FeatureCollection", "features": [
 {"type": "Feature", "properties": {"keep": "in", "name": "bay"}, "geometry": {"type": "Polygon", "coordinates": [
  [[9.48, 47.65], [9.481, 47.65], [9.481, 47.651], [9.48, 47.651], [9.48, 47.65]],
  [[9.4804, 47.6504], [9.4806, 47.6504], [9.4806, 47.6506], [9.4804, 47.6504]]]}},
 {"type": "Feature", "properties": {}, "geometry": {"type": "LineString", "coordinates": [[9.48, 47.65], [9.5, 47.65]]}}
]}"""
ORIGIN = (47.65, 9.48)


def test_fence_files(tmp_path: Path) -> None:
    toml, geojson = tmp_path / "f.toml", tmp_path / "f.geojson"
    toml.write_text(TOML)
    geojson.write_text(GEOJSON)
    basin, island = load_fence(toml, ORIGIN)
    assert (basin.corners, island.corners) == (BASIN.corners, ISLAND.corners)
    bay, hole = load_fence(geojson, ORIGIN)
    assert (bay.keep, bay.name, len(bay.corners)) == (Keep.IN, "bay", 4)
    assert (hole.keep, len(hole.corners)) == (Keep.OUT, 3)
    assert is_allowed((bay, hole), (10.0, 10.0))
    assert not is_allowed((bay, hole), (41.0, 50.0))


@pytest.mark.parametrize(
    ("name", "text", "named"),
    [
        ("f.toml", "", "areas"),
        ("f.toml", TOML.replace('"in"', '"inside"'), "areas[0].keep"),
        ("f.toml", TOML.replace("x_m = 14, y_m = 8", "x_m = nan, y_m = 8"), "areas[1].corners[1]"),
        ("f.toml", TOML.replace("x_m = 14, y_m = 8", "y_m = 8"), "areas[1].corners[1]"),
        ("f.toml", TOML.replace("{x_m = 14, y_m = 12}", "{x_m = 9, y_m = 8}"), "cross"),
        ("f.toml", TOML.replace("{x_m = 14, y_m = 12}", "{x_m = 14, y_m = 8}"), "corners[1] and the next are the same"),
        ("f.toml", TOML.replace("y_m = 20", "y_m = 0.001"), "areas[0]"),
        ("f.toml", TOML + "colour = 3\n", "colour"),
        ("f.kml", TOML, "not a fence file"),
        ("f.geojson", GEOJSON.replace('"keep": "in", ', ""), "features[0]: properties.keep"),
        ("f.geojson", GEOJSON.replace('"in"', '"out"'), "features[0]: coordinates"),
        ("f.geojson", GEOJSON.replace("[9.48, 47.651], [9.48, 47.65]]", "[9.48, 47.651]]"), "is not closed"),
        ("f.geojson", GEOJSON.replace('"Polygon"', '"MultiPolygon"'), "MultiPolygon"),
        ("f.geojson", GEOJSON.replace('"Polygon"', '"Point"'), "has no Polygon"),
        ("f.geojson", GEOJSON.replace("[9.481, 47.651]", "[9.481, 97.651]"), "coordinates[0][2]"),
    ],
)
def test_mistakes_in_a_fence_are_named(tmp_path: Path, name: str, text: str, named: str) -> None:
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(UserError) as caught:
        load_fence(path, ORIGIN)
    assert str(path) in str(caught.value)
    assert named in str(caught.value)
    assert "\n" not in str(caught.value)
