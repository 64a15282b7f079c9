"""Fences in files: our TOML, or the Polygons of a GeoJSON. Formats: README.md beside this file."""

from __future__ import annotations

import itertools
import math
from pathlib import Path
from typing import Annotated, Any

import msgspec

from paani.config.section import Section
from paani.errors import UserError
from paani.messages import FenceArea, Keep
from paani_services.navigator.avoidance.fence import segments_meet
from paani_services.navigator.files.geojson import Position, Shape, coordinates, shapes, spot_of
from paani_services.navigator.files.line import clean_name
from paani_services.navigator.files.placing import Frame, LatLon, Origin, Spot, read_toml
from paani_services.navigator.guidance.path_progress import MIN_LEG_M

MAX_CORNERS = 1000  # of all areas together: each is looked at ten times a second
MIN_AREA_M2 = 1.0


class _Area(Section, frozen=True):
    keep: Keep
    corners: Annotated[tuple[Spot, ...], msgspec.Meta(min_length=3, max_length=MAX_CORNERS)]
    name: Annotated[str, msgspec.Meta(max_length=100)] = ""


class _File(Section, frozen=True):
    areas: Annotated[tuple[_Area, ...], msgspec.Meta(min_length=1, max_length=MAX_CORNERS)]
    origin: Origin | None = None


def load_fence(path: Path, map_deg: LatLon | None, where: str = "navigator.fence") -> tuple[FenceArea, ...]:
    """Read a fence onto the map. Raises UserError that names file, area and corner."""
    where = f"{where} {path}".lstrip()
    match path.suffix.lower():
        case ".toml":
            file = read_toml(path, where, _File)
            origin_deg = file.origin.lat_lon_deg if file.origin else None
            rows = [(area.keep, area.corners, area.name, f"areas[{n}]") for n, area in enumerate(file.areas)]
        case ".geojson" | ".json":
            origin_deg = None
            rows = [
                row for shape in shapes(path, where) for row in _rows(shape, shape.where.removeprefix(f"{where}: "))
            ]
        case _:
            raise UserError(f"{where}: not a fence file (have: .toml, .geojson, .json)")
    if not rows:
        raise UserError(f"{where}: has no Polygon")
    frame = Frame(where, origin_deg, map_deg)
    areas = tuple(
        FenceArea(
            keep=keep, name=name, corners=tuple(frame.place(spot, f"{at}.corners[{n}]") for n, spot in enumerate(spots))
        )
        for keep, spots, name, at in rows
    )
    if sum(len(area.corners) for area in areas) > MAX_CORNERS:
        raise UserError(f"{where}: more than {MAX_CORNERS} corners")
    for area, (_, _, _, at) in zip(areas, rows, strict=True):
        _require_simple(area, f"{where}: {at}")
    return areas


def _rows(shape: Shape, at: str) -> list[tuple[Keep, tuple[Spot, ...], str, str]]:
    """The areas of one geometry: the outer ring, and each hole as its opposite."""
    if shape.type == "MultiPolygon":
        raise UserError(f"{shape.where}: MultiPolygon: give each Polygon a Feature of its own")
    if shape.type != "Polygon":
        return []
    try:
        keep = msgspec.convert(shape.properties.get("keep"), Keep)
    except msgspec.ValidationError as error:
        raise UserError(f'{shape.where}: properties.keep of a Polygon is "in" or "out"') from error
    rings = coordinates(shape, tuple[tuple[Position, ...], ...])
    if not rings or (keep is Keep.OUT and len(rings) > 1):
        raise UserError(f"{shape.where}: coordinates: only an area that keeps in may have holes, and each has a ring")
    name = clean_name(str(_plain(shape.properties.get("name"))))
    found = []
    for number, ring in enumerate(rings):
        place = f"{at}.coordinates[{number}]"
        spots = tuple(spot_of(position, f"{shape.where}: {place}[{n}]") for n, position in enumerate(ring))
        if len(spots) < 4 or spots[0] != spots[-1]:
            raise UserError(f"{shape.where}: coordinates[{number}]: is not closed by its first position")
        found.append((keep if number == 0 else Keep.OUT, spots[:-1], name, place))
    return found


def _plain(value: Any) -> str:
    return value if isinstance(value, str) else ""


def _require_simple(area: FenceArea, where: str) -> None:
    """Raises UserError for an edge without length, edges that cross, or next to no area."""
    points = [(corner.x_m, corner.y_m) for corner in area.corners]
    edges = list(itertools.pairwise((*points, points[0])))
    for number, (start, end) in enumerate(edges):
        if math.dist(start, end) < MIN_LEG_M:
            raise UserError(f"{where}: corners[{number}] and the next are the same")
    for (one, first), (other, second) in itertools.combinations(enumerate(edges), 2):
        if other - one not in {1, len(edges) - 1} and segments_meet(first, second):
            raise UserError(f"{where}: the edges from corners[{one}] and corners[{other}] cross")
    if abs(sum(x1 * y2 - x2 * y1 for (x1, y1), (x2, y2) in edges)) / 2.0 < MIN_AREA_M2:
        raise UserError(f"{where}: has an area below {MIN_AREA_M2} m2")
