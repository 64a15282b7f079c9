"""Route files.

name = "lake"
repeat = true               # optional; false ends the route at its last waypoint

[origin]                    # only needed by geodetic waypoints
latitude_deg = 47.6512
longitude_deg = 9.4794

[[waypoints]]               # two or more, each in map metres or geodetic
x_m = 12.5
y_m = -3.0

[[waypoints]]
latitude_deg = 47.6513
longitude_deg = 9.4795
"""

import itertools
import tomllib
from pathlib import Path
from typing import Annotated

import msgspec

from paani.config.section import Section
from paani.errors import UserError
from paani.geometry import enu_from_geodetic
from paani.messages import Route, Waypoint

Coordinate = Annotated[float, msgspec.Meta(ge=-1e6, le=1e6)]
Latitude = Annotated[float, msgspec.Meta(ge=-90.0, le=90.0)]
Longitude = Annotated[float, msgspec.Meta(ge=-180.0, le=180.0)]


class _Origin(Section, frozen=True):
    latitude_deg: Latitude
    longitude_deg: Longitude


class _Point(Section, frozen=True):
    x_m: Coordinate | None = None
    y_m: Coordinate | None = None
    latitude_deg: Latitude | None = None
    longitude_deg: Longitude | None = None


class _File(Section, frozen=True):
    name: Annotated[str, msgspec.Meta(max_length=100)]
    waypoints: Annotated[tuple[_Point, ...], msgspec.Meta(min_length=2, max_length=10_000)]
    repeat: bool = True
    origin: _Origin | None = None


def load_route(path: Path) -> Route:
    """Read a route file. Raises UserError that names the file and the field."""
    try:
        tree = tomllib.loads(path.read_text(encoding="utf-8"))
        file = msgspec.convert(tree, _File)
    except OSError as error:
        raise UserError(f"navigator.route {path}: {error.strerror}") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, msgspec.ValidationError) as error:
        raise UserError(f"navigator.route {path}: {error}") from error
    waypoints = tuple(
        _waypoint(point, file.origin, f"navigator.route {path}: waypoints[{number}]")
        for number, point in enumerate(file.waypoints)
    )
    ring = (*waypoints, waypoints[0]) if file.repeat else waypoints
    for number, (one, other) in enumerate(itertools.pairwise(ring)):
        if one == other:
            raise UserError(f"navigator.route {path}: waypoints[{number}] and the next are the same")
    return Route(source_us=0, name=file.name, waypoints=waypoints, repeat=file.repeat)


def _waypoint(point: _Point, origin: _Origin | None, where: str) -> Waypoint:
    match point:
        case _Point(x_m=float(x_m), y_m=float(y_m), latitude_deg=None, longitude_deg=None):
            return Waypoint(x_m=x_m, y_m=y_m)
        case _Point(x_m=None, y_m=None, latitude_deg=float(lat), longitude_deg=float(lon)):
            if origin is None:
                raise UserError(f"{where}: latitude_deg needs the file's [origin]")
            east_m, north_m = enu_from_geodetic(lat, lon, origin.latitude_deg, origin.longitude_deg)
            return Waypoint(x_m=east_m, y_m=north_m)
    raise UserError(f"{where}: needs x_m and y_m, or latitude_deg and longitude_deg")
