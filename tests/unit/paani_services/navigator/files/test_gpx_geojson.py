"""Routes between GPX, GeoJSON and TOML, and the error for files that are no routes."""

from __future__ import annotations

import codecs
import itertools
import math
import sys
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paani.cli import main as paani
from paani.errors import UserError
from paani.geometry import enu_from_geodetic
from paani_services.navigator.files.line_simplification import simplify_line
from paani_services.navigator.files.map_frame import FilePoint
from paani_services.navigator.files.route_file import encode_route, lat_lon_of_points, load_route, read_route
from paani_services.navigator.files.route_line import MAX_POINTS, RouteLine

pytestmark = pytest.mark.slow

SUFFIXES = (".gpx", ".geojson", ".toml")
GPX = """<?xml version="1.0"?>
<gpx version="1.1" creator="a plotter" xmlns="http://www.topografix.com/GPX/1/1">
 <wpt lat="47.0" lon="9.0"><name>berth</name></wpt>
 <rte><name>bay</name>
  <rtept lat="47.6500" lon="9.4800"/><rtept lat="47.6510" lon="9.4800"/><rtept lat="47.6510" lon="9.4820"/>
 </rte>
 <trk><trkseg><trkpt lat="47.1" lon="9.1"/><trkpt lat="47.2" lon="9.2"/></trkseg></trk>
</gpx>"""
GEOJSON = (
    '{"type": "Feature", "properties": {"name": "bay", "repeat": true}, "geometry": {"type": "LineString",'
    ' "coordinates": [[9.48, 47.65, 395.0], [9.48, 47.651], [9.482, 47.651], [9.48, 47.65]]}}'
)
TOML = 'name = "bay"\n[[waypoints]]\nx_m = 0\ny_m = 0\n[[waypoints]]\nx_m = 5\ny_m = 5\n'


def written(folder: Path, name: str, text: str | bytes) -> Path:
    path = folder / name
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path


names = st.text(max_size=60).map(lambda text: text.replace("\x00", "")).filter(lambda text: text.isprintable())
routes = st.builds(
    RouteLine,
    name=names.map(str.strip).filter(bool),
    points=st.lists(
        st.builds(FilePoint, latitude_deg=st.floats(-0.02, 0.02), longitude_deg=st.floats(-0.02, 0.02)),
        min_size=2,
        max_size=8,
    ).map(tuple),
    repeat=st.booleans(),
)


@given(
    line=routes, centre=st.tuples(st.floats(-80, 80), st.floats(-179, 179)), order=st.permutations([*SUFFIXES, ".toml"])
)
@settings(max_examples=60, deadline=None)
def test_round_trips_within_a_centimetre(
    tmp_path_factory: pytest.TempPathFactory, line: RouteLine, centre: tuple[float, float], order: list[str]
) -> None:
    """Through every format in any order: name, repetition and each point to less than 1 cm."""
    points = tuple(
        FilePoint(
            latitude_deg=round(centre[0] + (point.latitude_deg or 0.0), 9),
            longitude_deg=round(centre[1] + (point.longitude_deg or 0.0), 9),
        )
        for point in line.points
    )
    if any(one == other for one, other in itertools.pairwise((*points, points[0]))):
        return
    before = RouteLine(line.name, points, line.repeat)
    folder, now = tmp_path_factory.mktemp("trip"), before
    for number, suffix in enumerate(order):
        path = written(folder, f"{number}{suffix}", encode_route(now, suffix, "test"))
        now = read_route(path, "test")
    assert (now.name, now.repeat, len(now.points)) == (before.name, before.repeat, len(before.points))
    for one, other in zip(lat_lon_of_points(before, "test"), lat_lon_of_points(now, "test"), strict=True):
        assert math.hypot(*enu_from_geodetic(*one, *other)) < 0.01


def test_gpx_route_before_track_before_waypoints(tmp_path: Path) -> None:
    whole = read_route(written(tmp_path, "a.gpx", GPX), "test")
    assert (whole.name, len(whole.points), whole.repeat) == ("bay", 3, False)
    track = read_route(written(tmp_path, "b.gpx", GPX.replace("rte>", "x>").replace("rtept", "xpt")), "test")
    assert [point.latitude_deg for point in track.points] == [47.1, 47.2]


def test_geojson_with_heights_in_a_ring_beside_other_things(tmp_path: Path) -> None:
    point = '{"type": "Feature", "properties": null, "geometry": {"type": "Point", "coordinates": [9, 47]}}'
    text = f'{{"type": "FeatureCollection", "name": "x", "features": [{point}, {GEOJSON}]}}'
    line = read_route(written(tmp_path, "a.geojson", text), "test")
    assert (line.name, line.repeat, len(line.points)) == ("bay", True, 3)


BILLION_LAUGHS = '<!DOCTYPE gpx [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;">]><gpx><name>&b;</name></gpx>'


@pytest.mark.parametrize(
    ("name", "text", "named"),
    [
        ("a.gpx", "", "XML"),
        ("a.gpx", "<gpx>", "XML"),
        ("a.gpx", TOML, "XML"),
        ("a.gpx", BILLION_LAUGHS, "document type"),
        ("a.gpx", GPX.encode("utf-16"), "not UTF-8"),
        ("a.gpx", '<gpx version="1.1"/>', "no rtept, trkpt or wpt"),
        ("a.gpx", "<kml/>", "no rtept, trkpt or wpt"),
        ("a.gpx", GPX.replace(' lon="9.4820"', ""), "rtept[2]: lon is missing"),
        ("a.gpx", GPX.replace('lat="47.6510"', 'lat="north"', 1), "rtept[1]: lat is missing or no number"),
        ("a.gpx", GPX.replace('lat="47.6510"', 'lat="nan"', 1), "rtept[1]: lat nan"),
        ("a.gpx", GPX.replace('lat="47.6510"', 'lat="1e999"', 1), "rtept[1]: lat inf"),
        ("a.gpx", GPX.replace('lon="9.4820"', 'lon="181"'), "rtept[2]: lon 181.0"),
        ("a.gpx", GPX.replace('<rtept lat="47.6510" lon="9.4800"/><rtept lat="47.6510" lon="9.4820"/>', ""), "has 1"),
        ("a.gpx", GPX.replace("47.6510", "47.6500"), "waypoints[0] and the next are the same"),
        ("a.gpx", GPX.replace("</rte>", '</rte><rte><rtept lat="1" lon="1"/></rte>'), "rte: has 2"),
        ("a.geojson", "", "truncated"),
        ("a.geojson", "[" * 100_000, "object"),
        ("a.geojson", '{"type": "Feature", "geometry": ' * 50_000, ""),
        ("a.geojson", GEOJSON.replace("LineString", "Point"), "has 0 LineStrings"),
        ("a.geojson", GEOJSON.replace("[9.48, 47.651]", "[9.48, 97.651]"), "coordinates[1]: latitude 97.651"),
        ("a.geojson", GEOJSON.replace("[9.48, 47.651]", "[9.48]"), "coordinates[1]: has 1 numbers"),
        ("a.geojson", GEOJSON.replace("[9.48, 47.651]", '["x", 47.651]'), "coordinates"),
        ("a.geojson", GEOJSON.replace("47.65, 395.0", "1e999"), "coordinates"),
        ("a.geojson", GEOJSON.replace('"repeat": true', '"repeat": "yes"'), "properties.repeat"),
        ("a.toml", GPX, "Invalid statement"),
        ("a.toml", "a = " + "[" * 100_000, "recursion"),
        ("a.toml", b"\xff\xfe", "utf-8"),
        ("a.toml", TOML + "colour = 3\n", "waypoints[1]"),
        ("a.toml", TOML.replace("x_m = 5", "x_m = inf"), "waypoints[1].x_m"),
        ("a.kml", "<kml/>", "not a route file"),
        ("a", "", "not a route file"),
    ],
)
def test_a_file_that_is_no_route_gives_one_line_and_leaves_no_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, text: str | bytes, named: str
) -> None:
    path = written(tmp_path, name, text)
    with pytest.raises(UserError) as caught:
        load_route(path, (47.65, 9.48))
    assert str(path) in str(caught.value)
    assert named in str(caught.value)
    assert "\n" not in str(caught.value)
    if "the same" not in named:
        assert paani(["route", "convert", str(path), str(tmp_path / "out.toml")]) == 2
    assert paani(["route", "info", str(path)]) in {0, 2}
    assert paani(["route", "check", str(path)]) == 2
    assert {file.name for file in tmp_path.iterdir()} == {name}
    assert "Traceback" not in capsys.readouterr().err


def track(count: int) -> str:
    points = "".join(
        f'<trkpt lat="{47.65 + 1e-6 * number}" lon="{9.48 + 1e-4 * math.sin(0.01 * number):.9f}"/>'
        for number in range(count)
    )
    return f'<gpx version="1.1"><trk><trkseg>{points}</trkseg></trk></gpx>'


def test_a_recorded_track_is_simplified_on_request(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, out = written(tmp_path, "t.gpx", track(20_000)), tmp_path / "t.toml"
    with pytest.raises(UserError, match=r"waypoints: has 20000, more than 10000; thin it with .*--thin"):
        load_route(path, (47.65, 9.48))
    assert paani(["route", "convert", str(path), str(out), "--thin", "0.5"]) == 0
    thin = read_route(out, "test")
    assert 50 < len(thin.points) < 1000
    assert "20000 waypoints" in capsys.readouterr().err


def test_more_points_than_any_route_has_are_refused_before_they_are_read(tmp_path: Path) -> None:
    point = '<trkpt lat="47.0" lon="9.0"/>'
    path = written(tmp_path, "t.gpx", f"<gpx><trk><trkseg>{point * (MAX_POINTS + 1)}</trkseg></trk></gpx>")
    with pytest.raises(UserError, match="more than 100000 points"):
        read_route(path, "test")


@given(st.lists(st.tuples(st.floats(-100, 100), st.floats(-100, 100)), min_size=2, max_size=60), st.floats(0.01, 20.0))
@settings(deadline=None)
def test_simplification_moves_the_line_by_no_more_than_the_tolerance(
    points: list[tuple[float, float]], tolerance_m: float
) -> None:
    keep = simplify_line(tuple(points), tolerance_m)
    assert keep[0] == 0
    assert keep[-1] == len(points) - 1
    for first, last in itertools.pairwise(keep):
        (x1, y1), (x2, y2) = points[first], points[last]
        for x, y in points[first + 1 : last]:
            length2 = (x2 - x1) ** 2 + (y2 - y1) ** 2
            part = ((x - x1) * (x2 - x1) + (y - y1) * (y2 - y1)) / length2 if length2 else 0.0
            part = min(1.0, max(0.0, part))
            assert math.hypot(x - x1 - part * (x2 - x1), y - y1 - part * (y2 - y1)) <= tolerance_m + 1e-9


def test_a_line_that_cannot_be_simplified_costs_bounded_work() -> None:
    """A zigzag that grows keeps every point; each is still compared with at most 250 others, a few times."""
    zigzag = tuple((float(number), (-1.0) ** number * (1.0 + 0.01 * number)) for number in range(5000))
    assert len(simplify_line(zigzag, 0.5)) == 5000


def test_without_gpxpy_only_gpx_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The board installs no extra: TOML and GeoJSON load, GPX says what is missing."""
    monkeypatch.setitem(sys.modules, "gpxpy", None)
    gpx, geojson = written(tmp_path, "a.gpx", GPX), written(tmp_path, "a.geojson", GEOJSON)
    assert paani(["route", "info", str(gpx)]) == 2
    assert "GPX needs gpxpy, of the extra 'host'" in capsys.readouterr().err
    assert paani(["route", "convert", str(geojson), str(tmp_path / "a.toml")]) == 0


@pytest.mark.parametrize("origin", ["90,2", "-85.1,2", "10,181", "nan,0"])
def test_an_origin_near_a_pole_is_no_origin(tmp_path: Path, capsys: pytest.CaptureFixture[str], origin: str) -> None:
    path, out = tmp_path / "a.toml", tmp_path / "a.gpx"
    path.write_text(TOML)
    with pytest.raises(SystemExit, match="2"):
        paani(["route", "convert", str(path), str(out), f"--origin={origin}"])
    assert f"argument --origin: '{origin}': expected LAT,LON" in capsys.readouterr().err
    latitude_deg, longitude_deg = origin.split(",")
    path.write_text(f"{TOML}[origin]\nlatitude_deg = {latitude_deg}\nlongitude_deg = {longitude_deg}\n")
    assert paani(["route", "convert", str(path), str(out)]) == 2
    assert "a.toml: " in (printed := capsys.readouterr().err)
    assert "origin" in printed
    assert not out.exists()


@pytest.mark.parametrize(("suffix", "origin"), [(".gpx", "10,10"), (".toml", "85,10")])
def test_an_origin_far_from_the_route_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], suffix: str, origin: str
) -> None:
    path, out = tmp_path / f"a{suffix}", tmp_path / "b.toml"
    path.write_text(GPX if suffix == ".gpx" else TOML.replace("y_m = 0", "y_m = 900000", 1))
    assert paani(["route", "convert", str(path), str(out), "--origin", origin]) == 2
    assert capsys.readouterr().err.startswith(
        f"paani: --origin {float(origin.split(',', 1)[0]):.7f}, 10.0000000: {path}: "
    )
    assert not out.exists()


def test_a_file_may_begin_with_a_byte_order_mark(tmp_path: Path) -> None:
    for name, text in (("a.gpx", GPX), ("a.geojson", GEOJSON), ("a.toml", TOML)):
        line = read_route(written(tmp_path, name, codecs.BOM_UTF8 + text.encode()), "test")
        assert line == read_route(written(tmp_path, name, text), "test")


def test_a_route_with_an_origin_takes_no_other(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = written(tmp_path, "a.toml", f"{TOML}[origin]\nlatitude_deg = 47\nlongitude_deg = 9\n")
    assert paani(["route", "convert", str(path), str(tmp_path / "b.gpx"), "--origin", "47.65,9.48"]) == 2
    assert capsys.readouterr().err == f"paani: --origin: {path} has its own (47.0000000, 9.0000000)\n"
    assert not (tmp_path / "b.gpx").exists()


def test_a_route_across_the_180th_meridian_is_read_again(tmp_path: Path) -> None:
    path, gpx, back = (tmp_path / name for name in ("a.toml", "a.gpx", "b.toml"))
    path.write_text(TOML)
    assert paani(["route", "convert", str(path), str(gpx), "--origin", "10,180"]) == 0
    assert paani(["route", "convert", str(gpx), str(back)]) == 0
    assert [(point.x_m, point.y_m) for point in load_route(back).waypoints] == [
        pytest.approx(place_m, abs=1e-3) for place_m in ((0.0, 0.0), (5.0, 5.0))
    ]


def test_metres_without_an_origin_need_one_to_become_latitudes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, out = written(tmp_path, "a.toml", TOML), tmp_path / "a.gpx"
    assert paani(["route", "convert", str(path), str(out)]) == 2
    assert "origin: waypoints[0] in metres needs it" in capsys.readouterr().err
    assert not out.exists()
    assert paani(["route", "convert", str(path), str(out), "--origin", "47.65,9.48"]) == 0
    assert lat_lon_of_points(read_route(out, "test"), "test")[0] == (47.65, 9.48)


def test_a_route_across_the_antimeridian_is_short(tmp_path: Path) -> None:
    line = RouteLine(
        "fiji",
        (FilePoint(latitude_deg=-17.0, longitude_deg=179.9999), FilePoint(latitude_deg=-17.0, longitude_deg=-179.9999)),
    )
    path = written(tmp_path, "a.geojson", encode_route(line, ".geojson", "test"))
    first, last = load_route(path, (-17.0, -179.9995)).waypoints
    assert last.x_m - first.x_m == pytest.approx(21.3, abs=0.1)


def test_info_gives_the_points_and_the_place_of_a_route(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert paani(["route", "info", str(written(tmp_path, "a.geojson", GEOJSON))]) == 0
    output = capsys.readouterr().out
    assert "3, again and again" in output
    assert "47.6500000, 9.4800000" in output


def test_check_refuses_a_route_outside_a_fence_or_a_world(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    corners = "{x_m = -9, y_m = -9}, {x_m = 9, y_m = -9}, {x_m = 9, y_m = FAR}, {x_m = -9, y_m = FAR}"
    fence = f'[[areas]]\nkeep = "in"\ncorners = [{corners}]\n'
    route = written(tmp_path, "a.toml", TOML)
    wide, narrow = written(tmp_path, "w.toml", fence.replace("FAR", "99")), tmp_path / "n.toml"
    narrow.write_text(fence.replace("FAR", "4"))
    assert paani(["route", "check", str(route), "--fence", str(wide)]) == 0
    assert paani(["route", "check", str(route), "--fence", str(narrow)]) == 2
    assert "waypoints[1]" in capsys.readouterr().err
    assert paani(["route", "check", str(route), "--world", "atlantis"]) == 2
    assert "atlantis" in capsys.readouterr().err
    land = written(tmp_path, "land.toml", TOML.replace("x_m = 5", "x_m = 5000"))
    assert paani(["route", "check", str(land), "--world", "lake"]) == 2
    assert "waypoints[1]: is outside the fence (world lake)" in capsys.readouterr().err


def test_a_route_at_a_pole_has_no_metres(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, out = written(tmp_path, "a.gpx", GPX.replace("47.65", "86.65")), tmp_path / "a.toml"
    assert paani(["route", "convert", str(path), str(out)]) == 2
    assert "waypoints[0]: latitude 86.65 is too near to a pole" in capsys.readouterr().err
    assert not out.exists()
