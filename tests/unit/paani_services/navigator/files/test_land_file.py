"""Land from a file: the areas it gives, what is refused because of it, and the errors that name what is wrong."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import msgspec
import pytest

from paani.cli import main as paani
from paani.config import load_config
from paani.errors import UserError
from paani.geometry import geodetic_from_enu
from paani.messages import Keep
from paani_services.navigator.files.land_file import load_land
from paani_services.navigator.files.mission_file import load_route_and_mission
from tests.places import ROOT

PAANI = load_config().navigator
ORIGIN = (47.65, 9.48)
ROUTE = 'name = "r"\nrepeat = false\n[[waypoints]]\nx_m = 0\ny_m = 0\n[[waypoints]]\nx_m = 20\ny_m = 0\n'
Ring = list[list[float]]


def ring(west_m: float, south_m: float, east_m: float, north_m: float) -> Ring:
    places = ((west_m, south_m), (east_m, south_m), (east_m, north_m), (west_m, north_m), (west_m, south_m))
    return [list(reversed(geodetic_from_enu(*place, *ORIGIN))) for place in places]


def written(folder: Path, kind: str, coordinates: Any, file: str = "land.geojson", **properties: str) -> Path:
    path = folder / file
    geometry = {"type": kind, "coordinates": coordinates}
    path.write_text(json.dumps({"type": "Feature", "properties": properties, "geometry": geometry}))
    return path


ISLAND, SHORE = ring(8, -4, 12, 4), ring(-50, 30, 50, 40)


def test_each_polygon_is_an_area_to_keep_out_of(tmp_path: Path) -> None:
    island, shore = load_land(written(tmp_path, "MultiPolygon", [[ISLAND], [SHORE]]), ORIGIN)
    assert (island.keep, island.name, len(island.corners)) == (Keep.OUT, "land", 4)
    assert (island.corners[1].x_m, island.corners[1].y_m) == pytest.approx((12.0, -4.0), abs=1e-6)
    assert (shore.keep, shore.name) == (Keep.OUT, "land")
    (named,) = load_land(written(tmp_path, "Polygon", [ISLAND], file="l.json", keep="out", name="rock"), ORIGIN)
    assert named.name == "rock"


@pytest.mark.parametrize(
    ("kind", "coordinates", "fault"),
    [
        ("Polygon", [ISLAND, ring(9, -1, 11, 1)], "coordinates: has 2 rings"),
        ("MultiPolygon", [[SHORE], [ISLAND[:-1]]], r"coordinates\[1\]\[0\]: is not closed"),
        ("MultiPolygon", [[SHORE], []], r"coordinates\[1\]: has 0 rings"),
        ("Polygon", [[[9.48, 97.65], *ISLAND]], r"coordinates\[0\]\[0\]: latitude 97\.65"),
        ("Polygon", [[ISLAND[0], ISLAND[2], ISLAND[1], ISLAND[3], ISLAND[0]]], r"coordinates\[0\]: the edges .* cross"),
        ("Polygon", [[*ISLAND[:-1], *ISLAND[-2:]]], r"coordinates\[0\]: corners\[3\] and the next are the same"),
        (
            "Polygon",
            [[[9.48 + n * 1e-6, 47.65 + n * n * 1e-9] for n in range(1001)] + [[9.48, 47.65]]],
            "more than 1000",
        ),
        ("Polygon", 3, "coordinates: "),
        ("Point", [9.48, 47.65], "has no Polygon"),
    ],
)
def test_mistakes_in_land_are_named(tmp_path: Path, kind: str, coordinates: Any, fault: str) -> None:
    with pytest.raises(UserError, match=rf"^navigator\.land {tmp_path}/land\.geojson: .*{fault}"):
        load_land(written(tmp_path, kind, coordinates), ORIGIN)


def test_what_is_no_file_of_land_is_named(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"properties\.keep: land is kept out of"):
        load_land(written(tmp_path, "Polygon", [ISLAND], keep="in"), ORIGIN)
    with pytest.raises(UserError, match=r"navigator\.land .*land\.toml: not a land file"):
        load_land(tmp_path / "land.toml", ORIGIN)
    with pytest.raises(UserError, match=r"navigator\.land .*none\.geojson: No such file"):
        load_land(tmp_path / "none.geojson", ORIGIN)
    with pytest.raises(UserError, match=r"latitude_deg needs localization\.origin_lat_lon_deg"):
        load_land(written(tmp_path, "Polygon", [ISLAND]), None)


@pytest.mark.parametrize(
    ("land", "fault"),
    [
        (ISLAND, r"waypoints\[0\]: the leg to the next crosses land"),
        (ring(18, -4, 25, 4), r"waypoints\[1\]: is on land"),
        (ring(8, 1, 12, 4), r"waypoints\[0\]: the leg to the next comes nearer than 1\.5 m to land"),
        (ring(21, -4, 25, 4), r"waypoints\[1\]: is nearer than 1\.5 m to land"),
    ],
)
def test_a_route_across_land_is_refused_with_its_waypoint(tmp_path: Path, land: Ring, fault: str) -> None:
    route, file = tmp_path / "r.toml", written(tmp_path, "Polygon", [land])
    route.write_text(ROUTE)
    with pytest.raises(UserError, match=rf"^navigator\.route .*r\.toml: {fault}$"):
        load_route_and_mission(msgspec.structs.replace(PAANI, route=str(route), land=str(file)), ORIGIN)


def test_land_is_known_beside_a_fence_and_without_anything_to_do(tmp_path: Path) -> None:
    route, shore = tmp_path / "r.toml", written(tmp_path, "Polygon", [SHORE])
    route.write_text(ROUTE)
    fence = tmp_path / "f.toml"
    fence.write_text('[[areas]]\nkeep = "in"\ncorners = [{x_m=-9, y_m=-9}, {x_m=90, y_m=-9}, {x_m=-9, y_m=90}]\n')
    alone = msgspec.structs.replace(PAANI, land=str(shore))
    both = msgspec.structs.replace(alone, route=str(route), fence=str(fence))
    _, mission = load_route_and_mission(both, ORIGIN)
    assert mission is not None
    assert (len(mission.legs), len(mission.fence), len(mission.land)) == (1, 1, 1)
    assert mission.bounds == (*mission.fence, *mission.land)
    route_to_show, nothing = load_route_and_mission(alone, ORIGIN)
    assert nothing is not None
    assert (route_to_show, nothing.legs, nothing.land) == (None, (), mission.land)


@pytest.mark.slow
def test_fence_and_land_share_their_corners(tmp_path: Path) -> None:
    """Each is tested at every step of the navigator."""
    arc = [(0.1 * n, 30.0 + 0.001 * n * n) for n in range(998)]
    shore = written(tmp_path, "Polygon", [[list(reversed(geodetic_from_enu(*at, *ORIGIN))) for at in (*arc, arc[0])]])
    fence, route = tmp_path / "f.toml", tmp_path / "r.toml"
    fence.write_text('[[areas]]\nkeep = "in"\ncorners = [{x_m=-99, y_m=-9}, {x_m=99, y_m=-9}, {x_m=0, y_m=90}]\n')
    route.write_text(ROUTE)
    config = msgspec.structs.replace(PAANI, route=str(route), land=str(shore), fence=str(fence))
    with pytest.raises(UserError, match=r"f\.toml: more than 1000 corners with those of navigator\.land"):
        load_route_and_mission(config, ORIGIN)


@pytest.mark.slow
def test_a_route_is_checked_against_land_before_the_boat_starts(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bay, shores = str(ROOT / "examples" / "bay.gpx"), str(ROOT / "examples" / "shores.geojson")
    assert paani(["route", "check", bay, "--land", shores]) == 0
    assert capsys.readouterr().out == f"{bay}: 5 waypoints, good, off {shores}\n"
    across = tmp_path / "across.toml"
    head = 'name = "across"\n[origin]\nlatitude_deg = 47.6512\nlongitude_deg = 9.4794\n'
    across.write_text(f"{head}[[waypoints]]\nx_m = 60\ny_m = 20\n[[waypoints]]\nx_m = 130\ny_m = 60\n")
    assert paani(["route", "check", str(across), "--land", shores]) == 2
    assert f"waypoints[0]: the leg to the next crosses land ({shores})" in capsys.readouterr().err
