"""Form of a scenario file, and its strict reader. README.md beside this file shows one.

Frames of points: `map` (metres east and north of the origin), `route` (metres along the route from the boat's start,
and to its left) and `channel` (the same of the world's centre line, from its first point).
"""

import tomllib
from pathlib import Path
from typing import Annotated, Literal

import msgspec

from paani.config.section import Fraction, Section
from paani.errors import UserError
from paani.undecodable import UNDECODABLE
from paani_sim.worlds.encounter_paths import Encounter
from paani_sim.worlds.faults import FaultKind
from paani_sim.worlds.world import Behaviour

MAX_BYTES = 256 * 1024
MAX_ACTORS = 32
MAX_POINTS = 200  # of a path, a route or an area

Name = Annotated[str, msgspec.Meta(pattern=r"^[A-Za-z0-9_.-]{1,60}$")]
Coordinate = Annotated[float, msgspec.Meta(ge=-1e5, le=1e5)]
Degrees = Annotated[float, msgspec.Meta(ge=-360.0, le=360.0)]
Seconds = Annotated[float, msgspec.Meta(ge=0.0, le=1e6)]
Length = Annotated[float, msgspec.Meta(ge=0.05, le=200.0)]  # [m]; MuJoCo takes a hull much smaller for a flat mesh
Distance = Annotated[float, msgspec.Meta(ge=0.0, le=1e5)]
Seed = Annotated[int, msgspec.Meta(ge=0, le=2**31)]
Point = tuple[Coordinate, Coordinate]
Line = Annotated[tuple[Point, ...], msgspec.Meta(min_length=2, max_length=MAX_POINTS)]
Area = Annotated[tuple[Point, ...], msgspec.Meta(min_length=3, max_length=MAX_POINTS)]
Areas = Annotated[tuple[Area, ...], msgspec.Meta(max_length=MAX_ACTORS)]


class WorldPart(Section, frozen=True):
    """Which world; what is left out is the world's own.

    `banks`, `obstacles` and `actors`: whether its own ones are kept. Without banks there is open water all round.
    """

    kind: str
    seed: Seed | None = None
    origin_lat_deg: Annotated[float, msgspec.Meta(ge=-90.0, le=90.0)] | None = None
    origin_lon_deg: Annotated[float, msgspec.Meta(ge=-180.0, le=180.0)] | None = None
    water_rgb: tuple[Fraction, Fraction, Fraction] | None = None
    season_frac: Fraction | None = None
    banks: bool = True
    obstacles: bool = True
    actors: bool = True


class LightPart(Section, frozen=True):
    """Sky and sun; angles counter-clockwise from east and above the horizon."""

    sky: Literal["clear", "cloudy", "overcast", "dusk", "hazy"] | None = None
    sun_azimuth_deg: Degrees | None = None
    sun_elevation_deg: Annotated[float, msgspec.Meta(ge=0.0, le=90.0)] | None = None
    seed: Seed | None = None


class WeatherPart(Section, frozen=True):
    """Wind, waves, current, rain and fog."""

    wind_mps: Annotated[float, msgspec.Meta(ge=0.0, le=30.0)] | None = None
    wind_toward_deg: Degrees | None = None
    gust_frac: Fraction | None = None
    gust_s: Annotated[float, msgspec.Meta(gt=0.0, le=1e4)] | None = None
    fetch_m: Annotated[float, msgspec.Meta(ge=0.0, le=1e5)] | None = None
    current_mps: Annotated[float, msgspec.Meta(ge=0.0, le=3.0)] | None = None
    current_toward_deg: Degrees | None = None
    rain_mmph: Annotated[float, msgspec.Meta(ge=0.0, le=100.0)] | None = None
    visibility_m: Annotated[float, msgspec.Meta(ge=20.0, le=1e5)] | None = None


class ShoalPart(Section, frozen=True):
    """A rise of the bottom, round from above; `top_m` of water over its middle."""

    at_m: Point
    radius_m: Annotated[float, msgspec.Meta(ge=0.5, le=200.0)]
    top_m: Annotated[float, msgspec.Meta(ge=0.0, le=1000.0)]
    frame: Literal["map", "route", "channel"] = "map"


class DepthPart(Section, frozen=True):
    """Depth of the water at rest: of its flat bottom, and the shoals on that."""

    bottom_m: Annotated[float, msgspec.Meta(ge=0.5, le=1000.0)] | None = None
    shoals: Annotated[tuple[ShoalPart, ...], msgspec.Meta(max_length=MAX_ACTORS)] = ()


class VesselPart(Section, frozen=True):
    """The vessel profile."""

    profile: str = "paper"


class ActorPart(Section, frozen=True):
    """A thing that stays (`at_m`), runs along a path (`path_m`) or meets the boat (`encounter` and `meets_at_m`).

    `heading_deg` is counter-clockwise from east in the map, else to the left of route or channel; of an encounter it is
    the way a crossing goes or something drifts, to the left of the route. `left_m` is where beside the route it is met.
    Sizes are the look's usual ones where they are left out.
    """

    look: str
    id: Name | None = None
    frame: Literal["map", "route", "channel"] = "map"
    at_m: Point | None = None
    path_m: Line | None = None
    encounter: Encounter | None = None
    meets_at_m: Distance | None = None
    left_m: Annotated[float, msgspec.Meta(ge=-50.0, le=50.0)] = 0.0
    heading_deg: Degrees | None = None
    speed_mps: Annotated[float, msgspec.Meta(gt=0.0, le=15.0)] | None = None
    closed: bool = False
    start_m: Distance = 0.0
    start_s: Seconds = 0.0
    behaviour: Behaviour = Behaviour.HOLDS_ON
    length_m: Length | None = None
    width_m: Length | None = None
    height_m: Length | None = None
    base_z_m: Annotated[float, msgspec.Meta(ge=0.0, le=50.0)] = 0.0
    variant: Annotated[int, msgspec.Meta(ge=0, le=1000)] = 0


class RoutePart(Section, frozen=True):
    """Own waypoints in the map, or part of the world's own route, or (left out) all of it."""

    waypoints_m: Line | None = None
    closed: bool = False
    from_m: Distance | None = None
    length_m: Annotated[float, msgspec.Meta(gt=1.0, le=1e5)] | None = None


class TaskPart(Section, frozen=True):
    """How far along the route (left out: all of it), and in which time (left out: thrice that of 0.6 m/s, and 60 s)."""

    distance_m: Annotated[float, msgspec.Meta(gt=0.0, le=1e5)] | None = None
    time_limit_s: Annotated[float, msgspec.Meta(gt=0.0, le=1e6)] | None = None


class FaultPart(Section, frozen=True):
    """One fault; `amount` in the unit of its kind."""

    kind: FaultKind
    start_s: Seconds
    duration_s: Annotated[float, msgspec.Meta(gt=0.0, le=1e6)] | None = None
    amount: Annotated[float, msgspec.Meta(ge=-1e4, le=1e4)] = 0.0


class FencePart(Section, frozen=True):
    """Polygons in the map: inside one of the first, outside all of the second."""

    keep_in: Areas = ()
    keep_out: Areas = ()


class ScenarioFile(Section, frozen=True):
    """The whole file."""

    world: WorldPart
    seed: Seed = 1
    light: LightPart = LightPart()
    weather: WeatherPart = WeatherPart()
    depth: DepthPart = DepthPart()
    vessel: VesselPart = VesselPart()
    route: RoutePart = RoutePart()
    task: TaskPart = TaskPart()
    fence: FencePart = FencePart()
    actors: Annotated[tuple[ActorPart, ...], msgspec.Meta(max_length=MAX_ACTORS)] = ()
    faults: Annotated[tuple[FaultPart, ...], msgspec.Meta(max_length=MAX_ACTORS)] = ()


def read_scenario_file(path: Path) -> ScenarioFile:
    """Raises UserError that names the file and the field."""
    try:
        with path.open("rb") as stream:
            data = stream.read(MAX_BYTES + 1)
        if len(data) > MAX_BYTES:
            raise UserError(f"scenario {path}: larger than {MAX_BYTES // 1024} KiB")
        return msgspec.convert(tomllib.loads(data.decode("utf-8-sig")), ScenarioFile)
    except OSError as error:
        raise UserError(f"scenario {path}: {error.strerror}") from error
    except UNDECODABLE as error:
        raise UserError(f"scenario {path}: {error}") from error
