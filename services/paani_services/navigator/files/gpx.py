"""GPX 1.0 and 1.1 routes: the first kind of route, track and waypoints that the file has.

Needs gpxpy, of the extra `host`; the board reads TOML and GeoJSON without it.
"""

from __future__ import annotations

from pathlib import Path
from types import ModuleType
from typing import Any
from xml.etree import ElementTree as ET

from paani.errors import UserError
from paani_services.navigator.files.line import MAX_POINTS, Line, clean_name
from paani_services.navigator.files.placing import LatLon, Spot, one_line, read_bytes

REPEAT = "repeat"  # <type> of a route that is sailed again and again
MAX_NAMESPACES = 100
POINTS = ("rtept", "trkpt", "wpt")


def read_gpx(path: Path, where: str) -> Line:
    """A GPX file. Raises UserError naming file and element; entities are never expanded."""
    gpxpy = _gpxpy(where)
    text = _text(path, where)
    try:
        gpx = gpxpy.parse(text)
    except (gpxpy.gpx.GPXException, ValueError, RecursionError) as error:
        raise UserError(f"{where}: {_culprit(text) or one_line(error)}") from error
    name, kind, element, points = _chosen(gpx, where)
    spots = tuple(_spot(point, f"{where}: {element}[{number}]") for number, point in enumerate(points))
    repeat = kind == REPEAT
    if repeat and len(spots) > 2 and spots[0] == spots[-1]:
        spots = spots[:-1]
    return Line(clean_name(name or path.stem), spots, repeat)


def route_gpx(line: Line, lat_lon_deg: tuple[LatLon, ...]) -> str:
    """A GPX file with one route. One that repeats says so in its <type> and ends where it begins."""
    gpxpy = _gpxpy("GPX")
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


def _gpxpy(where: str) -> ModuleType:
    try:
        import gpxpy  # noqa: PLC0415  # the board does without
        import gpxpy.gpx  # noqa: PLC0415
    except ModuleNotFoundError as error:
        raise UserError(f"{where}: GPX needs gpxpy, of the extra 'host'; TOML and GeoJSON do not") from error
    module: ModuleType = gpxpy
    return module


def _text(path: Path, where: str) -> str:
    try:
        text = read_bytes(path, where).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise UserError(f"{where}: not UTF-8 text") from error
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise UserError(f"{where}: has a document type, which GPX does not")
    if text.count("xmlns") > MAX_NAMESPACES:
        raise UserError(f"{where}: declares more than {MAX_NAMESPACES} namespaces")
    if sum(text.count(f"<{name}") for name in POINTS) > MAX_POINTS:
        raise UserError(f"{where}: more than {MAX_POINTS} points")
    return text


def _chosen(gpx: Any, where: str) -> tuple[str | None, str | None, str, list[Any]]:
    """Name, type, element and points of what is to be followed."""
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


def _spot(point: Any, where: str) -> Spot:
    if not -90.0 <= point.latitude <= 90.0:
        raise UserError(f"{where}: lat {point.latitude} is not in -90..90")
    if not -180.0 <= point.longitude <= 180.0:
        raise UserError(f"{where}: lon {point.longitude} is not in -180..180")
    return Spot(latitude_deg=float(point.latitude), longitude_deg=float(point.longitude))


def _culprit(text: str) -> str:
    """The first point without two numbers; empty where it is something else."""
    try:
        root = ET.fromstring(text)
    except (ET.ParseError, ValueError, RecursionError):
        return ""
    counts = dict.fromkeys(POINTS, -1)
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
