"""Land files: the Polygons and MultiPolygons of a GeoJSON file. The format is described in the navigator's README."""

from __future__ import annotations

from pathlib import Path

from paani.errors import UserError
from paani.messages import FenceArea, Keep
from paani_services.navigator.files.fence_file import AreaRow, Rings, build_areas, name_of, points_of_ring
from paani_services.navigator.files.geojson import Geometry, decode_coordinates, read_geometries
from paani_services.navigator.files.map_frame import LatLon, MapFrame

NAME = "land"


def load_land(path: Path, map_origin_deg: LatLon | None, where: str = "navigator.land") -> tuple[FenceArea, ...]:
    """Read land onto the map as areas to keep out of. Raises UserError that names file, polygon and position."""
    where = f"{where} {path}".lstrip()
    if path.suffix.lower() not in {".geojson", ".json"}:
        raise UserError(f"{where}: not a land file (have: .geojson, .json)")
    rows = [row for geometry in read_geometries(path, where) for row in _areas_of_geometry(geometry, where)]
    if not rows:
        raise UserError(f"{where}: has no Polygon")
    return build_areas(rows, MapFrame(where, None, map_origin_deg))


def _areas_of_geometry(geometry: Geometry, where: str) -> list[AreaRow]:
    if geometry.type == "MultiPolygon":
        polygons = decode_coordinates(geometry, tuple[Rings, ...])
        places = [f"coordinates[{number}]" for number in range(len(polygons))]
    elif geometry.type == "Polygon":
        polygons, places = (decode_coordinates(geometry, Rings),), ["coordinates"]
    else:
        return []
    if geometry.properties.get("keep", "out") != "out":
        raise UserError(f"{geometry.where}: properties.keep: land is kept out of")
    at = geometry.where.removeprefix(where).removeprefix(": ")
    found = []
    for rings, place in zip(polygons, places, strict=True):
        if len(rings) != 1:
            raise UserError(
                f"{geometry.where}: {place}: has {len(rings)} rings; water in land is a fence that keeps in"
            )
        points = points_of_ring(geometry, rings[0], f"{place}[0]")
        found.append((Keep.OUT, points, name_of(geometry) or NAME, f"{at}.{place}[0]".lstrip(".")))
    return found
