"""GeoJSON (RFC 7946): one LineString is a route, Polygons are a fence. One file may hold both."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from paani.errors import UserError
from paani_services.navigator.files.line import MAX_POINTS, Line, clean_name
from paani_services.navigator.files.placing import LatLon, Spot, one_line, read_bytes

T = TypeVar("T")
Position = tuple[float, ...]  # longitude, latitude, perhaps height


class _Node(msgspec.Struct, frozen=True):
    """A geometry, a Feature or a FeatureCollection; members that nobody asked for are left alone."""

    type: str
    coordinates: msgspec.Raw = msgspec.Raw(b"null")
    geometry: _Node | None = None
    features: tuple[_Node, ...] = ()
    properties: dict[str, Any] | None = None


class Shape(msgspec.Struct, frozen=True):
    """One geometry, where in the file it is, and the properties of its Feature."""

    type: str
    where: str
    coordinates: msgspec.Raw
    properties: dict[str, Any]


def read_line(path: Path, where: str) -> Line:
    """The file's LineString. Raises UserError where it has none, several, or one that is no line."""
    lines = [shape for shape in shapes(path, where) if shape.type == "LineString"]
    if len(lines) != 1:
        raise UserError(f"{where}: has {len(lines)} LineStrings, and one is followed")
    line = lines[0]
    spots = tuple(
        spot_of(position, f"{line.where}.coordinates[{number}]")
        for number, position in enumerate(coordinates(line, tuple[Position, ...]))
    )
    if len(spots) > MAX_POINTS:
        raise UserError(f"{where}: more than {MAX_POINTS} points")
    repeat = line.properties.get("repeat", False)
    if not isinstance(repeat, bool):
        raise UserError(f"{line.where}: properties.repeat is not true or false")
    if repeat and len(spots) > 2 and spots[0] == spots[-1]:
        spots = spots[:-1]
    return Line(clean_name(str(line.properties.get("name") or path.stem)), spots, repeat)


def route_geojson(line: Line, lat_lon_deg: tuple[LatLon, ...]) -> bytes:
    """A Feature. One that repeats says so in its properties and ends where it begins."""
    ring = (*lat_lon_deg, lat_lon_deg[0]) if line.repeat else lat_lon_deg
    positions = [(round(longitude_deg, 10), round(latitude_deg, 10)) for latitude_deg, longitude_deg in ring]
    feature = {
        "type": "Feature",
        "properties": {"name": line.name, "repeat": line.repeat},
        "geometry": {"type": "LineString", "coordinates": positions},
    }
    return msgspec.json.format(msgspec.json.encode(feature), indent=1) + b"\n"


def shapes(path: Path, where: str) -> list[Shape]:
    """Every geometry of the file. Raises UserError for what is no GeoJSON."""
    data = read_bytes(path, where)
    try:
        root = msgspec.json.decode(data, type=_Node)
    except (msgspec.MsgspecError, RecursionError, UnicodeDecodeError) as error:
        raise UserError(f"{where}: {one_line(error)}") from error
    if root.type == "FeatureCollection":
        return [
            shape for number, node in enumerate(root.features) for shape in _of(node, f"{where}: features[{number}]")
        ]
    return list(_of(root, where))


def coordinates(shape: Shape, kind: type[T]) -> T:
    """The geometry's coordinates in this shape. Raises UserError."""
    try:
        return msgspec.json.decode(shape.coordinates, type=kind)
    except (msgspec.MsgspecError, RecursionError) as error:
        raise UserError(f"{shape.where}: coordinates: {one_line(error)}") from error


def spot_of(position: Position, where: str) -> Spot:
    """A point of a longitude and a latitude. Raises UserError."""
    if len(position) not in {2, 3}:
        raise UserError(f"{where}: has {len(position)} numbers, not longitude and latitude")
    longitude_deg, latitude_deg = position[:2]
    if not -180.0 <= longitude_deg <= 180.0:
        raise UserError(f"{where}: longitude {longitude_deg} is not in -180..180")
    if not -90.0 <= latitude_deg <= 90.0:
        raise UserError(f"{where}: latitude {latitude_deg} is not in -90..90")
    return Spot(latitude_deg=latitude_deg, longitude_deg=longitude_deg)


def _of(node: _Node, where: str) -> Iterator[Shape]:
    if node.type == "Feature":
        if node.geometry is not None:
            yield Shape(node.geometry.type, where, node.geometry.coordinates, node.properties or {})
        return
    yield Shape(node.type, where, node.coordinates, {})
