"""Missions in files, and everything that the navigator is given to do. Format: README.md beside this file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import msgspec

from paani.config import NavigatorConfig
from paani.config.section import Positive, Section
from paani.errors import UserError
from paani.messages import LegKind, Mission, MissionLeg, Route, Waypoint
from paani_services.navigator.avoidance.fence import trouble
from paani_services.navigator.files.fence_file import load_fence
from paani_services.navigator.files.placing import Frame, LatLon, Origin, Spot, read_toml
from paani_services.navigator.files.route_file import MAX_WAYPOINTS, load_route
from paani_services.navigator.guidance.mission import route_alone

Radius = Annotated[float, msgspec.Meta(ge=1.0, le=1e3)]  # smaller than the boat's length it would never rest


class _Home(Spot, frozen=True):
    """A point, or none."""

    @property
    def is_given(self) -> bool:
        return any(value is not None for value in (self.x_m, self.y_m, self.latitude_deg, self.longitude_deg))


class _Follow(Section, frozen=True, tag_field="do", tag=LegKind.FOLLOW_ROUTE.value):
    """`route` is relative to the mission file; empty: `navigator.route`. `laps` 0: without end."""

    route: str = ""
    reverse: bool = False
    laps: Annotated[int, msgspec.Meta(ge=0, le=1_000_000)] = 1
    speed_mps: Positive | None = None


class _Hold(_Home, frozen=True, tag_field="do", tag=LegKind.HOLD_STATION.value):
    """Without a point: where the leg begins. Without a duration: until the operator stops the boat and arms it."""

    radius_m: Radius = 4.0
    duration_s: Positive | None = None
    speed_mps: Positive | None = None


class _Return(_Home, frozen=True, tag_field="do", tag=LegKind.RETURN_HOME.value):
    """Without a point: the mission's home, else where the boat was first free to move."""

    speed_mps: Positive | None = None


class _Stop(Section, frozen=True, tag_field="do", tag=LegKind.STOP.value):
    """No thrust until the operator stops the boat and arms it again."""


class _File(Section, frozen=True):
    legs: Annotated[tuple[_Follow | _Hold | _Return | _Stop, ...], msgspec.Meta(min_length=1, max_length=100)]
    name: Annotated[str, msgspec.Meta(max_length=100)] = ""
    origin: Origin | None = None
    home: Spot | None = None


def load_task(config: NavigatorConfig, map_deg: LatLon | None) -> tuple[Route | None, Mission | None]:
    """What the settings ask for: the route to begin with, and the mission where there is one or a fence.

    `map_deg`: the map's origin, latitude and longitude [deg]. Raises UserError that names file and field,
    also for a route that leaves the fence.
    """
    route = load_route(Path(config.route), map_deg) if config.route else None
    if not config.mission and not config.fence:
        return route, None
    if config.mission:
        where = f"navigator.mission {config.mission}"
        mission = load_mission(Path(config.mission), map_deg, route)
    else:
        where = f"navigator.route {config.route}"
        if route is None:
            raise UserError(f"navigator.fence {config.fence}: needs navigator.route or navigator.mission")
        mission = route_alone(route)
    if config.fence:
        mission = msgspec.structs.replace(mission, fence=load_fence(Path(config.fence), map_deg))
        _require_inside(mission, config.fence_margin_m, where, legs=bool(config.mission))
    return first_route(mission) or route, mission


def load_mission(path: Path, map_deg: LatLon | None, route: Route | None) -> Mission:
    """Read a mission file; `route` is that of legs that name none. Raises UserError that names file and field."""
    where = f"navigator.mission {path}"
    if path.suffix.lower() != ".toml":
        raise UserError(f"{where}: not a mission file (have: .toml)")
    file = read_toml(path, where, _File)
    frame = Frame(where, file.origin.lat_lon_deg if file.origin else None, map_deg)
    home = frame.place(file.home, "home") if file.home is not None else None
    legs = []
    for number, leg in enumerate(file.legs):
        at = f"legs[{number}]"
        match leg:
            case _Follow():
                legs.append(_followed(leg, path, map_deg, route, f"{where}: {at}"))
                if leg.laps == 0 and number + 1 < len(file.legs):
                    raise UserError(f"{where}: {at}.laps: 0 has no end, so no leg may come after it")
            case _Hold():
                place = _placed(leg, frame, at, None)
                legs.append(
                    MissionLeg(
                        kind=LegKind.HOLD_STATION,
                        waypoints=place,
                        radius_m=leg.radius_m,
                        duration_s=leg.duration_s or 0.0,
                        speed_mps=leg.speed_mps or 0.0,
                    )
                )
            case _Return():
                place = _placed(leg, frame, at, home)
                legs.append(MissionLeg(kind=LegKind.RETURN_HOME, waypoints=place, speed_mps=leg.speed_mps or 0.0))
            case _Stop():
                legs.append(MissionLeg(kind=LegKind.STOP))
    if sum(len(leg.waypoints) for leg in legs) > MAX_WAYPOINTS:
        raise UserError(f"{where}: legs: more than {MAX_WAYPOINTS} waypoints together")
    return Mission(source_us=0, name=file.name or path.stem, legs=tuple(legs))


def first_route(mission: Mission, leg: int = 0) -> Route | None:
    """The route of the first leg from this one on that follows any: what a map shows."""
    for each in mission.legs[leg:]:
        if each.kind is LegKind.FOLLOW_ROUTE:
            return Route(source_us=0, name=mission.name, waypoints=each.waypoints, repeat=each.repeat)
    return None


def _followed(leg: _Follow, path: Path, map_deg: LatLon | None, route: Route | None, where: str) -> MissionLeg:
    if leg.route:
        route = load_route(path.parent / leg.route, map_deg, f"{where}.route")
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


def _placed(point: _Home, frame: Frame, field: str, otherwise: Waypoint | None) -> tuple[Waypoint, ...]:
    if point.is_given:
        return (frame.place(point, field),)
    return () if otherwise is None else (otherwise,)


def _require_inside(mission: Mission, margin_m: float, where: str, *, legs: bool) -> None:
    for number, leg in enumerate(mission.legs):
        found = trouble(mission.fence, leg.waypoints, margin_m, repeat=leg.repeat)
        if found is not None:
            waypoint, what = found
            raise UserError(f"{where}: {f'legs[{number}].' if legs else ''}waypoints[{waypoint}]: {what}")
