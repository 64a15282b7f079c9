"""`paani route`: routes between GPX, GeoJSON and TOML, what is in them, and whether they can be sailed."""

from __future__ import annotations

import argparse
import contextlib
import itertools
import math
import subprocess
import sys
import tempfile
from pathlib import Path

from msgspec.structs import replace

from paani.config import load_config
from paani.errors import UserError
from paani.fence_geometry import FENCE_WORDS, LAND_WORDS, BorderWords, find_route_violation
from paani.geometry import MAX_ORIGIN_LATITUDE_DEG, geodetic_from_enu
from paani.messages import FenceArea
from paani.option_numbers import quantity
from paani.option_paths import input_file, output_file
from paani.whole_file import write_whole
from paani_services.navigator.files.fence_file import load_fence
from paani_services.navigator.files.land_file import load_land
from paani_services.navigator.files.line_simplification import simplify_line
from paani_services.navigator.files.map_frame import LatLon
from paani_services.navigator.files.route_file import (
    encode_route,
    in_own_metres,
    lat_lon_of_points,
    load_route,
    points_m,
    read_route,
    require_waypoint_count,
)
from paani_services.navigator.files.route_line import RouteLine

EXPORT_FENCE = "paani_sim.worlds.export_fence"  # a process of its own, so that the other commands need no simulator


def main(argv: list[str]) -> int:
    """Exit codes: 0 done, 2 user's mistake or a route that cannot be sailed."""
    options = _parser().parse_args(argv)
    run = {"convert": _convert, "info": _info, "check": _check}[options.command]
    run(options)
    return 0


def _convert(options: argparse.Namespace) -> None:
    where = str(options.source)
    line = read_route(options.source, where)
    if options.origin is not None:
        if line.origin_deg is not None:
            raise UserError(f"--origin: {where} has its own ({_lat_lon(line.origin_deg)})")
        line = _with_origin(line, options.origin, where)
    if options.thin is not None:
        line = _simplify_route(line, options.thin, where)
    if options.repeat:
        line = replace(line, repeat=True)
    require_waypoint_count(line, where)
    data = encode_route(line, options.target.suffix, str(options.target))
    write_whole(options.target, data)
    sys.stdout.write(f"{options.target}: {len(line.points)} waypoints\n")


def _with_origin(line: RouteLine, origin_deg: LatLon, where: str) -> RouteLine:
    """Raises UserError naming the option where the route lies too far from it."""
    line = replace(line, origin_deg=origin_deg)
    try:
        in_own_metres(line, where)
        lat_lon_of_points(line, where)
    except UserError as error:
        raise UserError(f"--origin {_lat_lon(origin_deg)}: {error}") from error
    return line


def _simplify_route(line: RouteLine, tolerance_m: float, where: str) -> RouteLine:
    keep = simplify_line(points_m(in_own_metres(line, where)), tolerance_m)
    sys.stderr.write(f"{where}: {len(line.points)} waypoints, {len(keep)} kept within {tolerance_m} m\n")
    return replace(line, points=tuple(line.points[number] for number in keep))


def _info(options: argparse.Namespace) -> None:
    where = str(options.source)
    line = read_route(options.source, where)
    require_waypoint_count(line, where)
    line = in_own_metres(line, where)
    points = points_m(line)
    ring = (*points, points[0]) if line.repeat else points
    lengths_m = [math.dist(one, other) for one, other in itertools.pairwise(ring)]
    rows = [
        ("name", line.name or "-"),
        ("waypoints", f"{len(points)}, {'again and again' if line.repeat else 'once'}"),
        ("length", f"{sum(lengths_m):.3f} m"),
        ("legs", f"{len(lengths_m)}, {min(lengths_m):.2f} to {max(lengths_m):.2f} m"),
        ("origin", _lat_lon(line.origin_deg) if line.origin_deg else "not given: metres on the map as it is"),
    ]
    (west_m, east_m), (south_m, north_m) = ((min(axis), max(axis)) for axis in zip(*points, strict=True))
    rows.append(("bounds", f"x {west_m:.2f} to {east_m:.2f} m, y {south_m:.2f} to {north_m:.2f} m"))
    if line.origin_deg is not None:
        corners = (geodetic_from_enu(*corner, *line.origin_deg) for corner in ((west_m, south_m), (east_m, north_m)))
        rows.append(("", " to ".join(_lat_lon(corner) for corner in corners)))
    sys.stdout.write("".join(f"{name:10} {value}\n" for name, value in rows))


def _check(options: argparse.Namespace) -> None:
    where = str(options.source)
    line = read_route(options.source, where)
    map_origin_deg = in_own_metres(line, where).origin_deg
    route = load_route(options.source, map_origin_deg, "")
    fences: list[tuple[str, tuple[FenceArea, ...], BorderWords]] = []
    if options.fence is not None:
        fences.append((str(options.fence), load_fence(options.fence, map_origin_deg, ""), FENCE_WORDS))
    if options.world is not None:
        fences.append((f"world {options.world}", _world_fence(options.world, map_origin_deg), FENCE_WORDS))
    if options.land is not None:
        fences.append((str(options.land), load_land(options.land, map_origin_deg, ""), LAND_WORDS))
    margin_m = load_config().navigator.fence_margin_m
    for name, fence, words in fences:
        found = find_route_violation(fence, route.waypoints, margin_m, repeat=route.repeat, words=words)
        if found is not None:
            raise UserError(f"{where}: waypoints[{found[0]}]: {found[1]} ({name})")
    within = [f"{'off' if words is LAND_WORDS else 'inside'} {name}" for name, _, words in fences]
    good = ", ".join(("good", *([" and ".join(within)] if within else [])))
    sys.stdout.write(f"{where}: {len(route.waypoints)} waypoints, {good}\n")


def _world_fence(world: str, map_origin_deg: LatLon | None) -> tuple[FenceArea, ...]:
    """The world's water as a fence, as the simulator's own exporter writes it."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "fence.toml"
        command = [sys.executable, "-m", EXPORT_FENCE, world, str(path)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            raise UserError((done.stderr.strip().splitlines() or [f"--world {world}: no such world"])[-1])
        return load_fence(path, map_origin_deg, f"--world {world}")


def _lat_lon(lat_lon_deg: LatLon) -> str:
    return f"{lat_lon_deg[0]:.7f}, {lat_lon_deg[1]:.7f}"


def _origin(text: str) -> LatLon:
    with contextlib.suppress(ValueError):
        latitude_deg, longitude_deg = (float(part) for part in text.split(","))
        if abs(latitude_deg) <= MAX_ORIGIN_LATITUDE_DEG and -180.0 <= longitude_deg <= 180.0:
            return latitude_deg, longitude_deg
    raise argparse.ArgumentTypeError(
        f"'{text}': expected LAT,LON in degrees, within {MAX_ORIGIN_LATITUDE_DEG:g} and 180"
    )


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="paani route", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    convert = commands.add_parser("convert", help="convert a route between .gpx, .geojson and .toml")
    convert.add_argument("source", type=input_file(), metavar="IN")
    convert.add_argument("target", type=output_file(""), metavar="OUT")
    convert.add_argument(
        "--thin",
        type=quantity("metres", 0.0, 1000.0),
        metavar="M",
        help="leave out points that lie less than M metres off the line",
    )
    convert.add_argument("--repeat", action="store_true", help="the last waypoint leads back to the first")
    convert.add_argument("--origin", type=_origin, metavar="LAT,LON", help="origin of a route in metres that has none")
    info = commands.add_parser("info", help="print length, legs, bounds and origin")
    info.add_argument("source", type=input_file(), metavar="FILE")
    check = commands.add_parser("check", help="check that the navigator can follow a route")
    check.add_argument("source", type=input_file(), metavar="FILE")
    check.add_argument("--fence", type=input_file("--fence"), metavar="FILE", help="fence that the route may not leave")
    check.add_argument("--land", type=input_file("--land"), metavar="FILE", help="land that the route may not cross")
    check.add_argument("--world", metavar="NAME", help="world whose water the route may not leave")
    return parser
