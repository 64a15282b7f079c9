"""Fence files: our TOML, or the Polygons of a GeoJSON file. The formats are described in the navigator's README."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import msgspec

from paani.config.section import Section
from paani.errors import UserError
from paani.messages import FenceArea, Keep
from paani.missions import MAX_CORNERS, count_corners, find_polygon_fault
from paani.undecodable import UNDECODABLE
from paani_services.navigator.files.bounded_reading import read_toml
from paani_services.navigator.files.geojson import (
    Geometry,
    Position,
    decode_coordinates,
    point_of_position,
    read_geometries,
)
from paani_services.navigator.files.map_frame import FilePoint, LatLon, MapFrame, Origin
from paani_services.navigator.files.route_line import clean_name

AreaRow = tuple[Keep, tuple[FilePoint, ...], str, str]  # keep, corners, name, place in the file
Rings = tuple[tuple[Position, ...], ...]  # the outer one first, then holes


class _FenceFileArea(Section, frozen=True):
    keep: Keep
    corners: Annotated[tuple[FilePoint, ...], msgspec.Meta(min_length=3, max_length=MAX_CORNERS)]
    name: Annotated[str, msgspec.Meta(max_length=100)] = ""


class _FenceFile(Section, frozen=True):
    areas: Annotated[tuple[_FenceFileArea, ...], msgspec.Meta(min_length=1, max_length=MAX_CORNERS)]
    origin: Origin | None = None


def load_fence(path: Path, map_origin_deg: LatLon | None, where: str = "navigator.fence") -> tuple[FenceArea, ...]:
    """Read a fence file onto the map. Raises UserError that names file, area and corner."""
    where = f"{where} {path}".lstrip()
    match path.suffix.lower():
        case ".toml":
            file = read_toml(path, where, _FenceFile)
            origin_deg = file.origin.lat_lon_deg if file.origin else None
            rows = [(area.keep, area.corners, area.name, f"areas[{n}]") for n, area in enumerate(file.areas)]
        case ".geojson" | ".json":
            origin_deg = None
            rows = [
                row
                for geometry in read_geometries(path, where)
                for row in _areas_of_geometry(geometry, geometry.where.removeprefix(f"{where}: "))
            ]
        case _:
            raise UserError(f"{where}: not a fence file (have: .toml, .geojson, .json)")
    if not rows:
        raise UserError(f"{where}: has no Polygon")
    return build_areas(rows, MapFrame(where, origin_deg, map_origin_deg))


def build_areas(rows: list[AreaRow], frame: MapFrame) -> tuple[FenceArea, ...]:
    """The areas on the map. Raises UserError that names area and corner."""
    where = frame.where
    areas = tuple(
        FenceArea(
            keep=keep,
            name=name,
            corners=tuple(frame.waypoint_of(point, f"{at}.corners[{n}]") for n, point in enumerate(points)),
        )
        for keep, points, name, at in rows
    )
    if count_corners(areas) > MAX_CORNERS:
        raise UserError(f"{where}: more than {MAX_CORNERS} corners")
    for area, (_, _, _, at) in zip(areas, rows, strict=True):
        fault = find_polygon_fault(area)
        if fault:
            raise UserError(f"{where}: {at}: {fault}")
    return areas


def _areas_of_geometry(geometry: Geometry, at: str) -> list[AreaRow]:
    """Areas of one geometry. The outer ring keeps as it says; holes, out."""
    if geometry.type == "MultiPolygon":
        raise UserError(f"{geometry.where}: MultiPolygon: give each Polygon a Feature of its own")
    if geometry.type != "Polygon":
        return []
    try:
        keep = msgspec.convert(geometry.properties.get("keep"), Keep)
    except UNDECODABLE as error:
        raise UserError(f'{geometry.where}: properties.keep of a Polygon is "in" or "out"') from error
    rings = decode_coordinates(geometry, Rings)
    if not rings or (keep is Keep.OUT and len(rings) > 1):
        raise UserError(
            f"{geometry.where}: coordinates: only an area that keeps in may have holes, and each has a ring"
        )
    name = name_of(geometry)
    found = []
    for number, ring in enumerate(rings):
        points = points_of_ring(geometry, ring, f"coordinates[{number}]")
        found.append((keep if number == 0 else Keep.OUT, points, name, f"{at}.coordinates[{number}]"))
    return found


def points_of_ring(geometry: Geometry, ring: tuple[Position, ...], at: str) -> tuple[FilePoint, ...]:
    """The corners of a ring, the last of which is not its first again. Raises UserError."""
    points = tuple(point_of_position(position, f"{geometry.where}: {at}[{n}]") for n, position in enumerate(ring))
    if len(points) < 4 or points[0] != points[-1]:
        raise UserError(f"{geometry.where}: {at}: is not closed by its first position")
    return points[:-1]


def name_of(geometry: Geometry) -> str:
    """The name that the properties give it; empty: none."""
    value = geometry.properties.get("name")
    return clean_name(value) if isinstance(value, str) else ""
