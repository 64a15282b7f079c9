"""Route files: what is accepted, and the line that names what is not."""

import itertools
import math
from pathlib import Path

import pytest

from paani.errors import UserError
from paani_services.navigator.files.route_file import load_route
from paani_sim.worlds import WORLDS, load_world
from paani_sim.worlds.export_route import route_toml

METRES = """
name = "pond"
[[waypoints]]
x_m = 0
y_m = 0.0
[[waypoints]]
x_m = 10.0
y_m = -2
"""
GEODETIC = """
name = "pond"
repeat = false
[origin]
latitude_deg = 47.65
longitude_deg = 9.48
[[waypoints]]
latitude_deg = 47.65
longitude_deg = 9.48
[[waypoints]]
latitude_deg = 47.6509
longitude_deg = 9.48
"""


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "route.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_points_in_metres_are_taken_as_they_are(tmp_path: Path) -> None:
    route = load_route(written(tmp_path, METRES))
    assert [(w.x_m, w.y_m) for w in route.waypoints] == [(0.0, 0.0), (10.0, -2.0)]
    assert (route.name, route.repeat) == ("pond", True)


def test_latitudes_are_placed_on_the_map(tmp_path: Path) -> None:
    route = load_route(written(tmp_path, GEODETIC), (47.65, 9.48))
    assert route.waypoints[0].x_m == 0.0
    assert route.waypoints[1].y_m == pytest.approx(100.07, abs=0.1)
    assert not route.repeat


def test_latitudes_need_the_origin_of_the_map(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"waypoints\[0\]: latitude_deg needs localization.origin_lat_lon_deg"):
        load_route(written(tmp_path, GEODETIC))


def test_a_route_with_an_origin_is_moved_onto_a_map_with_another(tmp_path: Path) -> None:
    """Metres from the file's origin and latitudes alike are moved onto a map with another origin."""
    north_deg = (47.651, 9.48)
    in_metres = "origin = {latitude_deg = 47.65, longitude_deg = 9.48}\n" + METRES
    here = load_route(written(tmp_path, GEODETIC), north_deg)
    there = load_route(written(tmp_path, in_metres), north_deg)
    assert here.waypoints[0].y_m == pytest.approx(-111.2, abs=0.1)
    assert there.waypoints[0].y_m == pytest.approx(here.waypoints[0].y_m)
    assert load_route(written(tmp_path, in_metres), (47.65, 9.48)) == load_route(written(tmp_path, METRES))


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("name = ", "Invalid value"),
        ('name = "a"\n', "waypoints"),
        ('name = "a"\n[[waypoints]]\nx_m = 1.0\ny_m = 1.0\n', "waypoints"),
        (METRES + "z_m = 3.0\n", "z_m"),
        (METRES.replace("y_m = -2", ""), "waypoints[1]"),
        (METRES.replace("x_m = 10.0", "x_m = nan"), "waypoints[1]"),
        (METRES.replace("x_m = 10.0", 'x_m = "ten"'), "waypoints[1].x_m"),
        (METRES.replace("10.0", "0").replace("-2", "0"), "waypoints[0] and the next are the same"),
        (GEODETIC.replace("[origin]", "[elsewhere]"), "elsewhere"),
        (GEODETIC.replace("latitude_deg = 47.6509", "latitude_deg = 91.0"), "latitude_deg"),
    ],
)
def test_mistakes_are_named(tmp_path: Path, text: str, named: str) -> None:
    path = written(tmp_path, text)
    with pytest.raises(UserError) as caught:
        load_route(path)
    assert str(path) in str(caught.value)
    assert named in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", sorted(WORLDS))
@pytest.mark.slow
def test_k2_route_of_each_world_is_a_route_file(tmp_path: Path, name: str) -> None:
    """K2: the lake's repeating route has 59 waypoints and is 465.443 m long, as the navigator reads it."""
    world = load_world(name)
    route = load_route(written(tmp_path, route_toml(world, world.name)))
    points = [(waypoint.x_m, waypoint.y_m) for waypoint in route.waypoints]
    length_m = sum(math.dist(one, other) for one, other in itertools.pairwise([*points, points[0]]))
    assert (route.name, route.repeat) == (name, True)
    assert length_m == pytest.approx(world.route_length_m, abs=0.01)
    if name == "lake":
        assert len(points) == 59
        assert length_m == pytest.approx(465.443, abs=0.01)


def test_a_missing_route_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="No such file"):
        load_route(tmp_path / "nowhere.toml")
