"""Routes in files: our TOML, GPX and GeoJSON, told apart by the file's suffix. Formats: README.md beside this file."""

from __future__ import annotations

import itertools
import json
import math
from pathlib import Path
from typing import Annotated

import msgspec

from paani.config.section import Section
from paani.errors import UserError
from paani.geometry import geodetic_from_enu
from paani.messages import Route
from paani_services.navigator.files.geojson import read_line, route_geojson
from paani_services.navigator.files.gpx import read_gpx, route_gpx
from paani_services.navigator.files.line import MAX_POINTS, Line, fraction_digits
from paani_services.navigator.files.placing import Frame, LatLon, Origin, Spot, read_toml
from paani_services.navigator.guidance.path_progress import MIN_LEG_M

MAX_WAYPOINTS = 10_000
SUFFIXES = (".toml", ".gpx", ".geojson", ".json")


class _File(Section, frozen=True):
    name: Annotated[str, msgspec.Meta(max_length=100)]
    waypoints: Annotated[tuple[Spot, ...], msgspec.Meta(min_length=2, max_length=MAX_POINTS)]
    repeat: bool = True
    origin: Origin | None = None


def load_route(path: Path, map_deg: LatLon | None = None, where: str = "navigator.route") -> Route:
    """Read a route of at most 10,000 waypoints. `map_deg`: the map's origin, latitude and longitude [deg].

    Where it is None, metres are taken as they are and latitudes are refused.
    Raises UserError that names file and field.
    """
    where = f"{where} {path}".lstrip()
    line = read_route(path, where)
    require_sailable(line, where)
    frame = Frame(where, line.origin_deg, map_deg)
    waypoints = tuple(frame.place(spot, f"waypoints[{number}]") for number, spot in enumerate(line.spots))
    ring = (*waypoints, waypoints[0]) if line.repeat else waypoints
    for number, (one, other) in enumerate(itertools.pairwise(ring)):
        if math.dist((one.x_m, one.y_m), (other.x_m, other.y_m)) < MIN_LEG_M:
            raise UserError(f"{where}: waypoints[{number}] and the next are the same")
    return Route(source_us=0, name=line.name, waypoints=waypoints, repeat=line.repeat)


def read_route(path: Path, where: str) -> Line:
    """What a file says, as it says it, of at most 100,000 points. Raises UserError naming file and field."""
    match path.suffix.lower():
        case ".toml":
            file = read_toml(path, where, _File)
            return Line(file.name, file.waypoints, file.repeat, file.origin.lat_lon_deg if file.origin else None)
        case ".gpx":
            return read_gpx(path, where)
        case ".geojson" | ".json":
            return read_line(path, where)
    raise UserError(f"{where}: not a route file (have: {', '.join(SUFFIXES)})")


def route_bytes(line: Line, suffix: str, where: str) -> bytes:
    """The file in the format of this suffix. Raises UserError for another, or where latitudes are not known."""
    match suffix.lower():
        case ".toml":
            return _toml(line, where).encode()
        case ".gpx":
            return route_gpx(line, geodetic(line, where)).encode()
        case ".geojson" | ".json":
            return route_geojson(line, geodetic(line, where))
    raise UserError(f"{where}: not a route file (have: {', '.join(SUFFIXES)})")


def require_sailable(line: Line, where: str) -> None:
    """Raises UserError for a line of one point or of too many."""
    count = len(line.spots)
    if count < 2:
        raise UserError(f"{where}: waypoints: has {count}, a route needs 2")
    if count > MAX_WAYPOINTS:
        raise UserError(
            f"{where}: waypoints: has {count}, more than {MAX_WAYPOINTS}; thin it with `paani route convert --thin 0.5`"
        )


def geodetic(line: Line, where: str) -> tuple[LatLon, ...]:
    """Latitude and longitude of each point [deg]. Raises UserError where the line has metres and no origin."""

    def lat_lon(spot: Spot, number: int) -> LatLon:
        match spot:
            case Spot(latitude_deg=float(latitude_deg), longitude_deg=float(longitude_deg), x_m=None, y_m=None):
                return latitude_deg, longitude_deg
            case Spot(x_m=float(x_m), y_m=float(y_m), latitude_deg=None, longitude_deg=None):
                if line.origin_deg is None:
                    raise UserError(f"{where}: origin: waypoints[{number}] in metres needs it (or --origin LAT,LON)")
                return geodetic_from_enu(x_m, y_m, *line.origin_deg)
        raise UserError(f"{where}: waypoints[{number}]: needs x_m and y_m, or latitude_deg and longitude_deg")

    return tuple(lat_lon(spot, number) for number, spot in enumerate(line.spots))


def on_own_map(line: Line, where: str) -> Line:
    """The same line in metres: from its origin, else from its first point; without either as it is."""
    origin_deg = line.origin_deg
    first = line.spots[0]
    if origin_deg is None and first.latitude_deg is not None and first.longitude_deg is not None:
        origin_deg = (first.latitude_deg, first.longitude_deg)
    frame = Frame(where, origin_deg, origin_deg)
    spots = (frame.place(spot, f"waypoints[{number}]") for number, spot in enumerate(line.spots))
    return Line(line.name, tuple(Spot(x_m=at.x_m, y_m=at.y_m) for at in spots), line.repeat, origin_deg)


def points_m(line: Line) -> tuple[tuple[float, float], ...]:
    """East and north of each point of a line in metres."""
    return tuple((spot.x_m or 0.0, spot.y_m or 0.0) for spot in line.spots)


def _toml(line: Line, where: str) -> str:
    line = on_own_map(line, where)
    head = f"name = {json.dumps(line.name, ensure_ascii=False)}\nrepeat = {str(line.repeat).lower()}\n"
    if line.origin_deg is not None:
        latitude_deg, longitude_deg = (fraction_digits(value, 10) for value in line.origin_deg)
        head += f"\n[origin]\nlatitude_deg = {latitude_deg}\nlongitude_deg = {longitude_deg}\n"
    points = (
        f"\n[[waypoints]]\nx_m = {fraction_digits(x_m, 4)}\ny_m = {fraction_digits(y_m, 4)}\n"
        for x_m, y_m in points_m(line)
    )
    return head + "".join(points)
