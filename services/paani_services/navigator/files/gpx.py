"""GPX 1.0 and 1.1 files: the route of a file, else its track, else its waypoints.

Needs gpxpy, which the extra `host` installs; the board reads TOML and GeoJSON without it.
"""

from __future__ import annotations

from pathlib import Path
from types import ModuleType
from typing import Any
from xml.etree import ElementTree as ET

from paani.errors import UserError
from paani_services.navigator.files.bounded_reading import read_bytes
from paani_services.navigator.files.map_frame import FilePoint, LatLon
from paani_services.navigator.files.route_line import MAX_POINTS, RouteLine, clean_name

REPEAT = "repeat"  # <type> of a route whose last point leads back to the first
MAX_NAMESPACES = 100  # declared in one file: the parser's work grows with the square of it
POINT_ELEMENTS = ("rtept", "trkpt", "wpt")


def read_gpx(path: Path, where: str) -> RouteLine:
    """The route of a GPX file. Raises UserError naming file and element; entities are never expanded."""
    gpxpy = _import_gpxpy(where)
    text = _read_text(path, where)
    try:
        gpx = gpxpy.parse(text)
    except (gpxpy.gpx.GPXException, ValueError, RecursionError) as error:
        raise UserError(f"{where}: {_find_bad_point(text) or error}") from error
    name, kind, element, found = _select_points(gpx, where)
    points = tuple(_point_of_element(point, f"{where}: {element}[{number}]") for number, point in enumerate(found))
    repeat = kind == REPEAT
    if repeat and len(points) > 2 and points[0] == points[-1]:
        points = points[:-1]
    return RouteLine(clean_name(name or path.stem), points, repeat)


def encode_gpx(line: RouteLine, lat_lon_deg: tuple[LatLon, ...]) -> str:
    """A GPX file with this one route. A route that repeats says so in its <type> and ends where it begins."""
    gpxpy = _import_gpxpy("GPX")
    gpx = gpxpy.gpx.GPX()
    gpx.creator = "paani"
    route = gpxpy.gpx.GPXRoute(name=line.name)
    if line.repeat:
        route.type = REPEAT
        lat_lon_deg = (*lat_lon_deg, lat_lon_deg[0])
    route.points = [
        gpxpy.gpx.GPXRoutePoint(round(latitude_deg, 10), round(longitude_deg, 10))
        for latitude_deg, longitude_deg in lat_lon_deg
    ]
    gpx.routes.append(route)
    text: str = gpx.to_xml()
    return text + "\n"


def _import_gpxpy(where: str) -> ModuleType:
    try:
        import gpxpy  # noqa: PLC0415  # not installed on the board
        import gpxpy.gpx  # noqa: PLC0415
    except ModuleNotFoundError as error:
        raise UserError(f"{where}: GPX needs gpxpy, of the extra 'host'; TOML and GeoJSON do not") from error
    module: ModuleType = gpxpy
    return module


def _read_text(path: Path, where: str) -> str:
    try:
        text = read_bytes(path, where).decode()
    except UnicodeDecodeError as error:
        raise UserError(f"{where}: not UTF-8 text") from error
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise UserError(f"{where}: has a document type, which GPX does not")
    if text.count("xmlns") > MAX_NAMESPACES:
        raise UserError(f"{where}: declares more than {MAX_NAMESPACES} namespaces")
    if sum(text.count(f"<{name}") for name in POINT_ELEMENTS) > MAX_POINTS:
        raise UserError(f"{where}: more than {MAX_POINTS} points")
    return text


def _select_points(gpx: Any, where: str) -> tuple[str | None, str | None, str, list[Any]]:
    """Name, type, element and points of the route, else of the track, else of the waypoints."""
    routes = [route for route in gpx.routes if route.points]
    tracks = [track for track in gpx.tracks if any(segment.points for segment in track.segments)]
    if len(routes) > 1 or (not routes and len(tracks) > 1):
        count, what = (len(routes), "rte") if routes else (len(tracks), "trk")
        raise UserError(f"{where}: {what}: has {count}, and only one can be followed")
    if routes:
        return routes[0].name, routes[0].type, "rtept", routes[0].points
    if tracks:
        points = [point for segment in tracks[0].segments for point in segment.points]
        return tracks[0].name, tracks[0].type, "trkpt", points
    if gpx.waypoints:
        return gpx.name, None, "wpt", gpx.waypoints
    raise UserError(f"{where}: no rtept, trkpt or wpt")


def _point_of_element(point: Any, where: str) -> FilePoint:
    if not -90.0 <= point.latitude <= 90.0:
        raise UserError(f"{where}: lat {point.latitude} is not in -90..90")
    if not -180.0 <= point.longitude <= 180.0:
        raise UserError(f"{where}: lon {point.longitude} is not in -180..180")
    return FilePoint(latitude_deg=float(point.latitude), longitude_deg=float(point.longitude))


def _find_bad_point(text: str) -> str:
    """Names the first point whose latitude or longitude is no number; empty where the fault is another."""
    try:
        root = ET.fromstring(text)
    except (ET.ParseError, ValueError, RecursionError):
        return ""
    counts = dict.fromkeys(POINT_ELEMENTS, -1)
    for element in root.iter():
        name = str(element.tag).rpartition("}")[2]
        if name not in counts:
            continue
        counts[name] += 1
        for field in ("lat", "lon"):
            try:
                float(element.get(field, ""))
            except ValueError:
                return f"{name}[{counts[name]}]: {field} is missing or no number"
    return ""
