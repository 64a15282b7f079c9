"""Mission files: the legs that they give, and the errors that name what is wrong in one."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest

from paani.config import load_config
from paani.errors import UserError
from paani.messages import LegKind, Route, Waypoint
from paani_services.navigator.files.mission_file import load_mission, load_route_and_mission, next_route

PAANI = load_config().navigator
SQUARE = tuple(Waypoint(x_m=x, y_m=y) for x, y in ((0.0, 0.0), (12.0, 0.0), (12.0, 12.0), (0.0, 12.0)))


ROUTE_TOML = "".join(
    ['name = "pond"\n', *(f"[[waypoints]]\nx_m = {x}\ny_m = {y}\n" for x, y in ((0, 0), (20, 0), (20, 10)))]
)
MISSION_TOML = """
name = "survey"

[home]
x_m = -2.0
y_m = 1.0

[[legs]]
do = "follow_route"
reverse = true
laps = 2
speed_mps = 0.4

[[legs]]
do = "hold_station"
x_m = 20.0
y_m = 10.0
radius_m = 3.0
duration_s = 60.0

[[legs]]
do = "return_home"

[[legs]]
do = "stop"
"""


def written(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def test_rally_points_of_a_mission_file_lie_within_the_fence_or_are_named(tmp_path: Path) -> None:
    corners = [f"{{x_m = {x}, y_m = {y}}}" for x, y in ((-30, -30), (50, -30), (50, 30), (-30, 30))]
    fence = written(tmp_path, "f.toml", f'[[areas]]\nkeep = "in"\ncorners = [{", ".join(corners)}]\n')
    route = written(tmp_path, "r.toml", ROUTE_TOML)
    mission = written(tmp_path, "m.toml", f"rally = [{{x_m = 5.0, y_m = 6.0}}]\n{MISSION_TOML}")
    config = msgspec.structs.replace(PAANI, route=str(route), mission=str(mission), fence=str(fence))
    _, loaded = load_route_and_mission(config, None)
    assert loaded is not None
    assert loaded.rally == (Waypoint(x_m=5.0, y_m=6.0),)
    written(tmp_path, "m.toml", f"rally = [{{x_m = 5.0, y_m = 6.0}}, {{x_m = 60.0, y_m = 0.0}}]\n{MISSION_TOML}")
    with pytest.raises(UserError, match=r"m\.toml: rally\[1\]: is outside the fence"):
        load_route_and_mission(config, None)


def test_home_lies_within_the_fence_even_where_no_leg_goes_there(tmp_path: Path) -> None:
    corners = ", ".join(f"{{x_m = {x}, y_m = {y}}}" for x, y in ((-9, -9), (9, -9), (9, 9), (-9, 9)))
    fence = written(tmp_path, "f.toml", f'[[areas]]\nkeep = "in"\ncorners = [{corners}]\n')
    mission = written(tmp_path, "m.toml", '[home]\nx_m = 8.9\ny_m = 0.0\n[[legs]]\ndo = "stop"\n')
    config = msgspec.structs.replace(PAANI, mission=str(mission), fence=str(fence))
    with pytest.raises(UserError, match=r"m\.toml: home: is nearer than 1\.5 m to the fence"):
        load_route_and_mission(config, None)


def test_a_mission_file_gives_its_legs_and_the_route_to_show(tmp_path: Path) -> None:
    route, mission = written(tmp_path, "r.toml", ROUTE_TOML), written(tmp_path, "m.toml", MISSION_TOML)
    config = msgspec.structs.replace(PAANI, route=str(route), mission=str(mission))
    route_to_show, loaded = load_route_and_mission(config, None)
    assert loaded is not None
    there, station, home, stop = loaded.legs
    assert [(w.x_m, w.y_m) for w in there.waypoints] == [(20, 10), (20, 0), (0, 0)]
    assert (there.repeat, there.laps, there.speed_mps) == (True, 2, 0.4)
    assert (station.waypoints, station.radius_m, station.duration_s) == ((Waypoint(x_m=20, y_m=10),), 3.0, 60.0)
    assert loaded.home == (Waypoint(x_m=-2, y_m=1),)
    assert (home.kind, home.waypoints, stop.kind) == (LegKind.RETURN_HOME, (Waypoint(x_m=-2, y_m=1),), LegKind.STOP)
    assert route_to_show == next_route(loaded)
    assert next_route(loaded, 1) is None


def test_the_route_alone_is_a_mission_of_one_leg_where_there_is_a_fence(tmp_path: Path) -> None:
    route = written(tmp_path, "r.toml", ROUTE_TOML)
    corners = "corners = [{x_m = -9, y_m = -9}, {x_m = 40, y_m = -9}, {x_m = 40, y_m = EAST}, {x_m = -9, y_m = EAST}]"
    fence = written(tmp_path, "f.toml", f'[[areas]]\nkeep = "in"\n{corners.replace("EAST", "40")}\n')
    assert load_route_and_mission(msgspec.structs.replace(PAANI, route=str(route)), None)[1] is None
    _, mission = load_route_and_mission(msgspec.structs.replace(PAANI, route=str(route), fence=str(fence)), None)
    assert mission is not None
    assert (len(mission.legs), mission.legs[0].laps, len(mission.fence)) == (1, 0, 1)
    low = written(tmp_path, "low.toml", f'[[areas]]\nkeep = "in"\n{corners.replace("EAST", "5")}\n')
    with pytest.raises(UserError, match=r"navigator\.route .*r\.toml: waypoints\[2\]: is outside the fence"):
        load_route_and_mission(msgspec.structs.replace(PAANI, route=str(route), fence=str(low)), None)
    mission_file = written(tmp_path, "m.toml", MISSION_TOML.replace("reverse = true", "reverse = false"))
    settings_ = msgspec.structs.replace(PAANI, route=str(route), fence=str(low), mission=str(mission_file))
    with pytest.raises(UserError, match=r"m\.toml: legs\[0\]\.waypoints\[2\]: is outside the fence"):
        load_route_and_mission(settings_, None)
    with pytest.raises(UserError, match=r"needs navigator\.route or navigator\.mission"):
        load_route_and_mission(msgspec.structs.replace(PAANI, fence=str(fence)), None)


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("", "legs"),
        ("legs = []", "legs"),
        (MISSION_TOML.replace('"stop"', '"dance"'), "legs[3]"),
        (MISSION_TOML.replace("laps = 2", "laps = -1"), "legs[0].laps"),
        (MISSION_TOML.replace("laps = 2", "laps = 0"), "legs[0].laps"),
        (MISSION_TOML.replace("laps = 2", "lap = 2"), "lap"),
        (MISSION_TOML.replace("radius_m = 3.0", "radius_m = 0.0"), "legs[1].radius_m"),
        (MISSION_TOML.replace("duration_s = 60.0", "duration_s = inf"), "legs[1].duration_s"),
        (MISSION_TOML.replace("x_m = 20.0\n", ""), "legs[1]"),
        (MISSION_TOML.replace("x_m = -2.0", "x_m = nan"), "home"),
        (MISSION_TOML.replace("reverse = true", 'route = "absent.toml"'), "legs[0].route"),
        (MISSION_TOML + "depth_m = 2\n", "depth_m"),
        ("\x00", "Invalid"),
    ],
)
def test_mistakes_in_a_mission_are_named(tmp_path: Path, text: str, named: str) -> None:
    path = written(tmp_path, "m.toml", text)
    route = Route(source_us=0, name="r", waypoints=SQUARE)
    with pytest.raises(UserError) as caught:
        load_mission(path, None, route)
    assert str(path) in str(caught.value)
    assert named in str(caught.value)
    assert "\n" not in str(caught.value)


def test_laps_of_a_route_that_ends_are_refused(tmp_path: Path) -> None:
    path = written(tmp_path, "m.toml", MISSION_TOML)
    once = Route(source_us=0, name="r", waypoints=SQUARE, repeat=False)
    with pytest.raises(UserError, match=r"legs\[0\]\.laps: 2, but the route does not repeat"):
        load_mission(path, None, once)
    with pytest.raises(UserError, match=r"legs\[0\]\.route: names none"):
        load_mission(path, None, None)
