"""Mission files, and loading all that the settings give the navigator to do. Format: the navigator's README."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import msgspec

from paani.config import NavigatorConfig
from paani.config.section import Positive, Section
from paani.errors import UserError
from paani.messages import FenceArea, LegKind, Mission, MissionLeg, Route, Waypoint
from paani.missions import (
    MAX_CORNERS,
    MAX_LAPS,
    MAX_LEGS,
    MAX_RADIUS_M,
    MAX_RALLY,
    MAX_WAYPOINTS,
    MIN_RADIUS_M,
    count_corners,
    find_home_fault,
    find_leg_outside,
    find_rally_fault,
    mission_of_route,
)
from paani_services.navigator.files.bounded_reading import read_toml
from paani_services.navigator.files.fence_file import load_fence
from paani_services.navigator.files.land_file import load_land
from paani_services.navigator.files.map_frame import FilePoint, LatLon, MapFrame, Origin
from paani_services.navigator.files.route_file import load_route

Radius = Annotated[float, msgspec.Meta(ge=MIN_RADIUS_M, le=MAX_RADIUS_M)]


class _OptionalPoint(FilePoint, frozen=True):
    """A leg's point, which may be left out."""

    @property
    def is_given(self) -> bool:
        return any(value is not None for value in (self.x_m, self.y_m, self.latitude_deg, self.longitude_deg))


class _FollowRouteLeg(Section, frozen=True, tag_field="do", tag=LegKind.FOLLOW_ROUTE.value):
    """`route` is relative to the mission file; empty: `navigator.route`. `laps` 0: without end."""

    route: str = ""
    reverse: bool = False
    laps: Annotated[int, msgspec.Meta(ge=0, le=MAX_LAPS)] = 1
    speed_mps: Positive | None = None


class _HoldStationLeg(_OptionalPoint, frozen=True, tag_field="do", tag=LegKind.HOLD_STATION.value):
    """Without a point: where the leg begins. Without a duration: until the operator stops the boat and arms it."""

    radius_m: Radius = 4.0
    duration_s: Positive | None = None
    speed_mps: Positive | None = None


class _ReturnHomeLeg(_OptionalPoint, frozen=True, tag_field="do", tag=LegKind.RETURN_HOME.value):
    """Without a point: the mission's home, else where the boat was first free to move."""

    speed_mps: Positive | None = None


class _StopLeg(Section, frozen=True, tag_field="do", tag=LegKind.STOP.value):
    """No thrust until the operator stops the boat and arms it again."""


class _MissionFile(Section, frozen=True):
    legs: Annotated[
        tuple[_FollowRouteLeg | _HoldStationLeg | _ReturnHomeLeg | _StopLeg, ...],
        msgspec.Meta(min_length=1, max_length=MAX_LEGS),
    ]
    name: Annotated[str, msgspec.Meta(max_length=100)] = ""
    origin: Origin | None = None
    home: FilePoint | None = None
    rally: Annotated[tuple[FilePoint, ...], msgspec.Meta(max_length=MAX_RALLY)] = ()


def load_route_and_mission(
    config: NavigatorConfig, map_origin_deg: LatLon | None
) -> tuple[Route | None, Mission | None]:
    """The route to begin with, and the mission if the settings name one, a fence or land.

    `map_origin_deg`: the map's origin, latitude and longitude [deg]. Raises UserError that names file and field,
    also for a route that leaves the fence or crosses land.
    """
    route = load_route(Path(config.route), map_origin_deg) if config.route else None
    land = load_land(Path(config.land), map_origin_deg) if config.land else ()
    if not config.mission and not config.fence and not land:
        return route, None
    if config.mission:
        where = f"navigator.mission {config.mission}"
        mission = load_mission(Path(config.mission), map_origin_deg, route)
    else:
        where = f"navigator.route {config.route}"
        if route is None and config.fence:
            raise UserError(f"navigator.fence {config.fence}: needs navigator.route or navigator.mission")
        mission = Mission(source_us=0, name="", legs=()) if route is None else mission_of_route(route)
    fence = load_fence(Path(config.fence), map_origin_deg) if config.fence else ()
    _require_within(mission, fence, land, config, where)
    return next_route(mission) or route, msgspec.structs.replace(mission, fence=fence, land=land)


def _require_within(
    mission: Mission, fence: tuple[FenceArea, ...], land: tuple[FenceArea, ...], config: NavigatorConfig, where: str
) -> None:
    """Raises UserError for a waypoint, home or rally point that fence or land forbid, and for too many corners."""
    if count_corners((*fence, *land)) > MAX_CORNERS:
        raise UserError(f"navigator.fence {config.fence}: more than {MAX_CORNERS} corners with those of navigator.land")
    margin_m = config.fence_margin_m
    found = find_leg_outside(mission.legs, fence, margin_m, land)
    if found is not None:
        leg, waypoint, what = found
        raise UserError(f"{where}: {f'legs[{leg}].' if config.mission else ''}waypoints[{waypoint}]: {what}")
    fault = find_home_fault(mission.home, fence, margin_m, land)
    if fault := fault or find_rally_fault(mission.rally, fence, margin_m, land):
        raise UserError(f"{where}: {fault}")


def load_mission(
    path: Path, map_origin_deg: LatLon | None, route: Route | None, where: str = "navigator.mission"
) -> Mission:
    """Read a mission file; `route` is followed by legs that name none. Raises UserError that names file and field."""
    where = f"{where} {path}".lstrip()
    if path.suffix.lower() != ".toml":
        raise UserError(f"{where}: not a mission file (have: .toml)")
    file = read_toml(path, where, _MissionFile)
    frame = MapFrame(where, file.origin.lat_lon_deg if file.origin else None, map_origin_deg)
    home = frame.waypoint_of(file.home, "home") if file.home is not None else None
    legs = []
    for number, leg in enumerate(file.legs):
        at = f"legs[{number}]"
        match leg:
            case _FollowRouteLeg():
                legs.append(_follow_route_leg(leg, path, map_origin_deg, route, f"{where}: {at}"))
                if leg.laps == 0 and number + 1 < len(file.legs):
                    raise UserError(f"{where}: {at}.laps: 0 has no end, so no leg may come after it")
            case _HoldStationLeg():
                waypoints = _waypoints_of_point(leg, frame, at, None)
                legs.append(
                    MissionLeg(
                        kind=LegKind.HOLD_STATION,
                        waypoints=waypoints,
                        radius_m=leg.radius_m,
                        duration_s=leg.duration_s or 0.0,
                        speed_mps=leg.speed_mps or 0.0,
                    )
                )
            case _ReturnHomeLeg():
                waypoints = _waypoints_of_point(leg, frame, at, home)
                legs.append(MissionLeg(kind=LegKind.RETURN_HOME, waypoints=waypoints, speed_mps=leg.speed_mps or 0.0))
            case _StopLeg():
                legs.append(MissionLeg(kind=LegKind.STOP))
    if sum(len(leg.waypoints) for leg in legs) > MAX_WAYPOINTS:
        raise UserError(f"{where}: legs: more than {MAX_WAYPOINTS} waypoints together")
    rally = tuple(frame.waypoint_of(point, f"rally[{number}]") for number, point in enumerate(file.rally))
    own_home = () if home is None else (home,)
    return Mission(source_us=0, name=file.name or path.stem, legs=tuple(legs), rally=rally, home=own_home)


def next_route(mission: Mission, leg: int = 0) -> Route | None:
    """The route of the first leg, from this one on, that follows a route: the one to show on a map."""
    for each in mission.legs[leg:]:
        if each.kind is LegKind.FOLLOW_ROUTE:
            return Route(source_us=0, name=mission.name, waypoints=each.waypoints, repeat=each.repeat)
    return None


def _follow_route_leg(
    leg: _FollowRouteLeg, path: Path, map_origin_deg: LatLon | None, route: Route | None, where: str
) -> MissionLeg:
    if leg.route:
        route = load_route(path.parent / leg.route, map_origin_deg, f"{where}.route")
    if route is None:
        raise UserError(f"{where}.route: names none, and navigator.route is empty")
    if leg.laps != 1 and not route.repeat:
        raise UserError(f"{where}.laps: {leg.laps}, but the route does not repeat")
    return MissionLeg(
        kind=LegKind.FOLLOW_ROUTE,
        waypoints=route.waypoints[::-1] if leg.reverse else route.waypoints,
        repeat=route.repeat,
        laps=leg.laps,
        speed_mps=leg.speed_mps or 0.0,
    )


def _waypoints_of_point(
    point: _OptionalPoint, frame: MapFrame, field: str, default: Waypoint | None
) -> tuple[Waypoint, ...]:
    """The point on the map, or the default; empty without either."""
    if point.is_given:
        return (frame.waypoint_of(point, field),)
    return () if default is None else (default,)
