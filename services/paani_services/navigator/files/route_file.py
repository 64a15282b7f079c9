"""Route files: our TOML, GPX and GeoJSON, told apart by the suffix. Formats: the navigator's README."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import msgspec

from paani.config.section import Section
from paani.errors import UserError
from paani.geometry import MAX_ORIGIN_LATITUDE_DEG, geodetic_from_enu
from paani.messages import Route
from paani.missions import MAX_WAYPOINTS, find_repeated_waypoint
from paani_services.navigator.files.bounded_reading import read_toml
from paani_services.navigator.files.geojson import encode_geojson, read_geojson_line
from paani_services.navigator.files.gpx import encode_gpx, read_gpx
from paani_services.navigator.files.map_frame import FilePoint, LatLon, MapFrame, Origin
from paani_services.navigator.files.route_line import MAX_POINTS, RouteLine, fixed_point_text

SUFFIXES = (".toml", ".gpx", ".geojson", ".json")


class _RouteFile(Section, frozen=True):
    name: Annotated[str, msgspec.Meta(max_length=100)]
    waypoints: Annotated[tuple[FilePoint, ...], msgspec.Meta(min_length=2, max_length=MAX_POINTS)]
    repeat: bool = True
    origin: Origin | None = None


def load_route(path: Path, map_origin_deg: LatLon | None = None, where: str = "navigator.route") -> Route:
    """Read a route of at most 10,000 waypoints. `map_origin_deg`: the map's origin, latitude and longitude [deg].

    Where it is None, metres are taken as they are and latitudes are refused.
    Raises UserError that names file and field.
    """
    where = f"{where} {path}".lstrip()
    line = read_route(path, where)
    require_waypoint_count(line, where)
    frame = MapFrame(where, line.origin_deg, map_origin_deg)
    waypoints = tuple(frame.waypoint_of(point, f"waypoints[{number}]") for number, point in enumerate(line.points))
    repeated = find_repeated_waypoint(waypoints, repeat=line.repeat)
    if repeated is not None:
        raise UserError(f"{where}: waypoints[{repeated}] and the next are the same")
    return Route(source_us=0, name=line.name, waypoints=waypoints, repeat=line.repeat)


def read_route(path: Path, where: str) -> RouteLine:
    """The route as the file gives it, at most 100,000 points. Raises UserError naming file and field."""
    match path.suffix.lower():
        case ".toml":
            file = read_toml(path, where, _RouteFile)
            return RouteLine(file.name, file.waypoints, file.repeat, file.origin.lat_lon_deg if file.origin else None)
        case ".gpx":
            return read_gpx(path, where)
        case ".geojson" | ".json":
            return read_geojson_line(path, where)
    raise UserError(f"{where}: not a route file (have: {', '.join(SUFFIXES)})")


def encode_route(line: RouteLine, suffix: str, where: str) -> bytes:
    """The route in the format of this suffix. Raises UserError for another, or where latitudes are not known."""
    match suffix.lower():
        case ".toml":
            return _encode_toml(line, where).encode()
        case ".gpx":
            return encode_gpx(line, lat_lon_of_points(line, where)).encode()
        case ".geojson" | ".json":
            return encode_geojson(line, lat_lon_of_points(line, where))
    raise UserError(f"{where}: not a route file (have: {', '.join(SUFFIXES)})")


def require_waypoint_count(line: RouteLine, where: str) -> None:
    """Raises UserError for a line of fewer than 2 points or more than `MAX_WAYPOINTS`."""
    count = len(line.points)
    if count < 2:
        raise UserError(f"{where}: waypoints: has {count}, a route needs 2")
    if count > MAX_WAYPOINTS:
        raise UserError(
            f"{where}: waypoints: has {count}, more than {MAX_WAYPOINTS}; thin it with `paani route convert --thin 0.5`"
        )


def lat_lon_of_points(line: RouteLine, where: str) -> tuple[LatLon, ...]:
    """Latitude and longitude of each point [deg]. Raises UserError: metres without origin, or beyond a pole."""

    def lat_lon_deg(point: FilePoint, number: int) -> LatLon:
        match point:
            case FilePoint(latitude_deg=float(latitude_deg), longitude_deg=float(longitude_deg), x_m=None, y_m=None):
                return latitude_deg, longitude_deg
            case FilePoint(x_m=float(x_m), y_m=float(y_m), latitude_deg=None, longitude_deg=None):
                if line.origin_deg is None:
                    raise UserError(f"{where}: origin: waypoints[{number}] in metres needs it (or --origin LAT,LON)")
                found_deg = geodetic_from_enu(x_m, y_m, *line.origin_deg)
                if abs(found_deg[0]) <= 90.0:
                    return found_deg
                raise UserError(f"{where}: waypoints[{number}]: lies beyond the pole, seen from the origin")
        raise UserError(f"{where}: waypoints[{number}]: needs x_m and y_m, or latitude_deg and longitude_deg")

    return tuple(lat_lon_deg(point, number) for number, point in enumerate(line.points))


def in_own_metres(line: RouteLine, where: str) -> RouteLine:
    """The same line in metres from its origin, else from its first point; a line in metres without origin as it is."""
    origin_deg = line.origin_deg
    first = line.points[0]
    if origin_deg is None and first.latitude_deg is not None and first.longitude_deg is not None:
        origin_deg = (first.latitude_deg, first.longitude_deg)
    if origin_deg is not None and abs(origin_deg[0]) > MAX_ORIGIN_LATITUDE_DEG:
        raise UserError(
            f"{where}: waypoints[0]: latitude {origin_deg[0]:g} is too near to a pole for metres on a plane"
        )
    frame = MapFrame(where, origin_deg, origin_deg)
    points = (frame.waypoint_of(point, f"waypoints[{number}]") for number, point in enumerate(line.points))
    return RouteLine(line.name, tuple(FilePoint(x_m=at.x_m, y_m=at.y_m) for at in points), line.repeat, origin_deg)


def points_m(line: RouteLine) -> tuple[tuple[float, float], ...]:
    """East and north of each point of a line in metres."""
    return tuple((point.x_m or 0.0, point.y_m or 0.0) for point in line.points)


def _encode_toml(line: RouteLine, where: str) -> str:
    line = in_own_metres(line, where)
    head = f"name = {json.dumps(line.name, ensure_ascii=False)}\nrepeat = {str(line.repeat).lower()}\n"
    if line.origin_deg is not None:
        latitude_deg, longitude_deg = (fixed_point_text(value, 10) for value in line.origin_deg)
        head += f"\n[origin]\nlatitude_deg = {latitude_deg}\nlongitude_deg = {longitude_deg}\n"
    points = (
        f"\n[[waypoints]]\nx_m = {fixed_point_text(x_m, 4)}\ny_m = {fixed_point_text(y_m, 4)}\n"
        for x_m, y_m in points_m(line)
    )
    return head + "".join(points)
