"""Points of route, mission and fence files, and where they lie on the map.

A file gives its points in metres from its `[origin]` (without one, from the map's origin), or as latitude and
longitude.
"""

from __future__ import annotations

from typing import Annotated

import msgspec

from paani.config.section import Section
from paani.errors import UserError
from paani.geometry import MAX_ORIGIN_LATITUDE_DEG, enu_from_geodetic, geodetic_from_enu
from paani.messages import Waypoint
from paani.missions import MAX_DISTANCE_M

Coordinate = Annotated[float, msgspec.Meta(ge=-MAX_DISTANCE_M, le=MAX_DISTANCE_M)]
Latitude = Annotated[float, msgspec.Meta(ge=-90.0, le=90.0)]
OriginLatitude = Annotated[float, msgspec.Meta(ge=-MAX_ORIGIN_LATITUDE_DEG, le=MAX_ORIGIN_LATITUDE_DEG)]
Longitude = Annotated[float, msgspec.Meta(ge=-180.0, le=180.0)]
LatLon = tuple[float, float]  # [deg]


class Origin(Section, frozen=True):
    """Where the file's metres are counted from."""

    latitude_deg: OriginLatitude
    longitude_deg: Longitude

    @property
    def lat_lon_deg(self) -> LatLon:
        return self.latitude_deg, self.longitude_deg


class FilePoint(Section, frozen=True):
    """A point as a file gives it: x_m and y_m, or latitude_deg and longitude_deg."""

    x_m: Coordinate | None = None
    y_m: Coordinate | None = None
    latitude_deg: Latitude | None = None
    longitude_deg: Longitude | None = None


class MapFrame(msgspec.Struct, frozen=True):
    """From a file's points to the map. `where` names the file and begins each error message.

    `file_origin_deg` is the file's origin, `map_origin_deg` the map's; None where it is not given.
    """

    where: str
    file_origin_deg: LatLon | None
    map_origin_deg: LatLon | None

    def waypoint_of(self, point: FilePoint, field: str) -> Waypoint:
        """The point on the map. Raises UserError that names the field."""
        match point:
            case FilePoint(x_m=float(x_m), y_m=float(y_m), latitude_deg=None, longitude_deg=None):
                file_deg, map_deg = self.file_origin_deg, self.map_origin_deg
                if file_deg is None or map_deg is None or file_deg == map_deg:
                    return Waypoint(x_m=x_m, y_m=y_m)
                return self._waypoint_of_geodetic(geodetic_from_enu(x_m, y_m, *file_deg), field)
            case FilePoint(x_m=None, y_m=None, latitude_deg=float(latitude_deg), longitude_deg=float(longitude_deg)):
                return self._waypoint_of_geodetic((latitude_deg, longitude_deg), field)
        raise UserError(f"{self.where}: {field}: needs x_m and y_m, or latitude_deg and longitude_deg")

    def _waypoint_of_geodetic(self, lat_lon_deg: LatLon, field: str) -> Waypoint:
        if self.map_origin_deg is None:
            raise UserError(f"{self.where}: {field}: latitude_deg needs localization.origin_lat_lon_deg")
        east_m, north_m = enu_from_geodetic(*lat_lon_deg, *self.map_origin_deg)
        if max(abs(east_m), abs(north_m)) > MAX_DISTANCE_M:
            raise UserError(f"{self.where}: {field}: more than 1000 km from the map's origin")
        return Waypoint(x_m=east_m, y_m=north_m)
