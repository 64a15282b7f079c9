"""GeoJSON (RFC 7946): one LineString is a route, Polygons are a fence. One file may hold both."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from paani.errors import UserError
from paani.undecodable import UNDECODABLE
from paani.whole_file import indented_json
from paani_services.navigator.files.bounded_reading import read_bytes
from paani_services.navigator.files.map_frame import FilePoint, LatLon
from paani_services.navigator.files.route_line import MAX_POINTS, RouteLine, clean_name

T = TypeVar("T")
Position = tuple[float, ...]  # longitude, latitude, perhaps height


class _Node(msgspec.Struct, frozen=True):
    """A geometry, a Feature or a FeatureCollection; other members are ignored."""

    type: str
    coordinates: msgspec.Raw = msgspec.Raw(b"null")
    geometry: _Node | None = None
    features: tuple[_Node, ...] = ()
    properties: dict[str, Any] | None = None


class Geometry(msgspec.Struct, frozen=True):
    """One geometry, its place in the file for error messages, and the properties of its Feature."""

    type: str
    where: str
    coordinates: msgspec.Raw
    properties: dict[str, Any]


def read_geojson_line(path: Path, where: str) -> RouteLine:
    """The file's LineString. Raises UserError where it has none or several, or a position is no place on Earth."""
    line_strings = [geometry for geometry in read_geometries(path, where) if geometry.type == "LineString"]
    if len(line_strings) != 1:
        raise UserError(f"{where}: has {len(line_strings)} LineStrings, and one is followed")
    line = line_strings[0]
    points = tuple(
        point_of_position(position, f"{line.where}.coordinates[{number}]")
        for number, position in enumerate(decode_coordinates(line, tuple[Position, ...]))
    )
    if len(points) > MAX_POINTS:
        raise UserError(f"{where}: more than {MAX_POINTS} points")
    repeat = line.properties.get("repeat", False)
    if not isinstance(repeat, bool):
        raise UserError(f"{line.where}: properties.repeat is not true or false")
    if repeat and len(points) > 2 and points[0] == points[-1]:
        points = points[:-1]
    return RouteLine(clean_name(str(line.properties.get("name") or path.stem)), points, repeat)


def encode_geojson(line: RouteLine, lat_lon_deg: tuple[LatLon, ...]) -> bytes:
    """The route as a GeoJSON Feature. One that repeats says so in its properties and ends where it begins."""
    ring = (*lat_lon_deg, lat_lon_deg[0]) if line.repeat else lat_lon_deg
    positions = [(round(longitude_deg, 10), round(latitude_deg, 10)) for latitude_deg, longitude_deg in ring]
    feature = {
        "type": "Feature",
        "properties": {"name": line.name, "repeat": line.repeat},
        "geometry": {"type": "LineString", "coordinates": positions},
    }
    return indented_json(feature)


def read_geometries(path: Path, where: str) -> list[Geometry]:
    """Every geometry of the file. Raises UserError for a file that is not GeoJSON."""
    data = read_bytes(path, where)
    try:
        root = msgspec.json.decode(data, type=_Node)
    except UNDECODABLE as error:
        raise UserError(f"{where}: {error}") from error
    if root.type == "FeatureCollection":
        return [
            geometry
            for number, node in enumerate(root.features)
            for geometry in _geometries_of_node(node, f"{where}: features[{number}]")
        ]
    return list(_geometries_of_node(root, where))


def decode_coordinates(geometry: Geometry, kind: type[T]) -> T:
    """The geometry's coordinates as this type. Raises UserError."""
    try:
        return msgspec.json.decode(geometry.coordinates, type=kind)
    except UNDECODABLE as error:
        raise UserError(f"{geometry.where}: coordinates: {error}") from error


def point_of_position(position: Position, where: str) -> FilePoint:
    """The point at a position of longitude and latitude. Raises UserError for any other position."""
    if len(position) not in {2, 3}:
        raise UserError(f"{where}: has {len(position)} numbers, not longitude and latitude")
    longitude_deg, latitude_deg = position[:2]
    if not -180.0 <= longitude_deg <= 180.0:
        raise UserError(f"{where}: longitude {longitude_deg} is not in -180..180")
    if not -90.0 <= latitude_deg <= 90.0:
        raise UserError(f"{where}: latitude {latitude_deg} is not in -90..90")
    return FilePoint(latitude_deg=latitude_deg, longitude_deg=longitude_deg)


def _geometries_of_node(node: _Node, where: str) -> Iterator[Geometry]:
    if node.type == "Feature":
        if node.geometry is not None:
            yield Geometry(node.geometry.type, where, node.geometry.coordinates, node.properties or {})
        return
    yield Geometry(node.type, where, node.coordinates, {})
