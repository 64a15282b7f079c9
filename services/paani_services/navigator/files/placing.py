"""Points of route, mission and fence files, and where they lie on the map.

A file gives points in metres from its `[origin]` (without one: from the map's), or as latitude and longitude.
"""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Annotated, TypeVar

import msgspec

from paani.config.section import Section
from paani.errors import UserError
from paani.geometry import enu_from_geodetic, geodetic_from_enu
from paani.messages import Waypoint

MAX_BYTES = 32 << 20  # a route of 100,000 points with names and times is smaller

Coordinate = Annotated[float, msgspec.Meta(ge=-1e6, le=1e6)]
Latitude = Annotated[float, msgspec.Meta(ge=-90.0, le=90.0)]
Longitude = Annotated[float, msgspec.Meta(ge=-180.0, le=180.0)]
LatLon = tuple[float, float]
T = TypeVar("T")


class Origin(Section, frozen=True):
    """Where the file's metres are counted from."""

    latitude_deg: Latitude
    longitude_deg: Longitude

    @property
    def lat_lon_deg(self) -> LatLon:
        return self.latitude_deg, self.longitude_deg


class Spot(Section, frozen=True):
    """A point: x_m and y_m, or latitude_deg and longitude_deg."""

    x_m: Coordinate | None = None
    y_m: Coordinate | None = None
    latitude_deg: Latitude | None = None
    longitude_deg: Longitude | None = None


class Frame(msgspec.Struct, frozen=True):
    """`file_deg` is the file's origin, `map_deg` the map's; None: not given. `where` begins each complaint."""

    where: str
    file_deg: LatLon | None
    map_deg: LatLon | None

    def place(self, spot: Spot, field: str) -> Waypoint:
        """On the map. Raises UserError that names the field."""
        match spot:
            case Spot(x_m=float(x_m), y_m=float(y_m), latitude_deg=None, longitude_deg=None):
                if self.file_deg is None or self.map_deg is None or self.file_deg == self.map_deg:
                    return Waypoint(x_m=x_m, y_m=y_m)
                return self._on_map(geodetic_from_enu(x_m, y_m, *self.file_deg), field)
            case Spot(x_m=None, y_m=None, latitude_deg=float(latitude_deg), longitude_deg=float(longitude_deg)):
                return self._on_map((latitude_deg, longitude_deg), field)
        raise UserError(f"{self.where}: {field}: needs x_m and y_m, or latitude_deg and longitude_deg")

    def _on_map(self, lat_lon_deg: LatLon, field: str) -> Waypoint:
        if self.map_deg is None:
            raise UserError(f"{self.where}: {field}: latitude_deg needs localization.origin_lat_lon_deg")
        east_m, north_m = enu_from_geodetic(*lat_lon_deg, *self.map_deg)
        if max(abs(east_m), abs(north_m)) > 1e6:
            raise UserError(f"{self.where}: {field}: more than 1000 km from the map's origin")
        return Waypoint(x_m=east_m, y_m=north_m)


def read_bytes(path: Path, where: str) -> bytes:
    """The whole file. Raises UserError where it cannot be read or is larger than any plan could be."""
    try:
        if path.stat().st_size > MAX_BYTES:
            raise UserError(f"{where}: larger than {MAX_BYTES >> 20} MiB")
        return path.read_bytes()
    except OSError as error:
        raise UserError(f"{where}: {error.strerror}") from error


def read_toml(path: Path, where: str, kind: type[T]) -> T:
    """A TOML file of this shape. Raises UserError naming the field."""
    data = read_bytes(path, where)
    try:
        return msgspec.convert(tomllib.loads(data.decode()), kind)
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, msgspec.ValidationError, RecursionError) as error:
        raise UserError(f"{where}: {one_line(error)}") from error


def one_line(error: Exception) -> str:
    """What went wrong, without line breaks."""
    return " ".join(str(error).split()) or type(error).__name__
