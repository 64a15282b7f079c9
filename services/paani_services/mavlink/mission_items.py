"""Items that a ground station uploads, as legs of a mission, areas of a fence, or rally points. Pure.

Waypoints in a row are a route. What the boat cannot do is refused with the number of the item, never left out.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

from msgspec.structs import replace

from paani import messages as m
from paani.missions import MIN_LEG_M, MIN_RADIUS_M
from paani_services.mavlink.codec import dialect
from paani_services.mavlink.fields import integer
from paani_services.mavlink.rover_modes import Mode

RESULT_FRAME, RESULT_UNSUPPORTED = dialect.MAV_MISSION_UNSUPPORTED_FRAME, dialect.MAV_MISSION_UNSUPPORTED
RESULT_INVALID, RESULT_PLACE = dialect.MAV_MISSION_INVALID, dialect.MAV_MISSION_INVALID_PARAM5_X
HOME_FRAMES = frozenset({dialect.MAV_FRAME_GLOBAL, dialect.MAV_FRAME_GLOBAL_INT})
PLACE_FRAMES = HOME_FRAMES | {dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT, dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT}
STATION_RADIUS_M = 4.0  # of an item that gives none, as in mission files
PASSING_S = 0.1  # a waypoint that is no route with another is a station that is left at once
CIRCLE_CORNERS = 32
NOWHERE = (0, 0)  # the protocol's "here"
KEEP_SPEED, DEFAULT_SPEED = -1.0, -2.0  # in the place of metres a second (MAV_CMD_DO_CHANGE_SPEED)

WaypointOf = Callable[[tuple[int, int]], m.Waypoint]
KEEPS = {
    dialect.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION: m.Keep.IN,
    dialect.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION: m.Keep.OUT,
    dialect.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION: m.Keep.IN,
    dialect.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION: m.Keep.OUT,
}
CIRCLES = frozenset({dialect.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, dialect.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION})


class Item(NamedTuple):
    """One item without its number: command, parameters, and the place in 1e-7 degrees (0, 0: none)."""

    command: int
    parameters: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    place_e7: tuple[int, int] = NOWHERE
    frame: int = dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT


class ItemError(Exception):
    """An item that is refused: `result` of the protocol, and a text that names it."""

    def __init__(self, seq: int, result: int, text: str) -> None:
        super().__init__(f"item {seq}: {text}")
        self.result = result


class Legs(NamedTuple):
    """`seq_of`: the item of each waypoint of each leg."""

    legs: tuple[m.MissionLeg, ...]
    seq_of: dict[tuple[int, int], int]


def legs_of_items(items: Sequence[Item], waypoint_of: WaypointOf) -> Legs:
    """Raises ItemError for the first item that the boat cannot do."""
    builder = _LegBuilder(waypoint_of)
    for seq, item in enumerate(items):
        builder.add(seq, item)
    builder.end_route()
    return Legs(tuple(builder.legs), builder.seq_of)


def areas_of_items(items: Sequence[Item], waypoint_of: WaypointOf) -> tuple[m.FenceArea, ...]:
    """The fence. A circle becomes a polygon on the safe side of it. Raises ItemError."""
    areas: list[m.FenceArea] = []
    seq = 0
    while seq < len(items):
        item = items[seq]
        keep, count = KEEPS.get(item.command), integer(item.parameters[0])
        if keep is None:
            raise ItemError(seq, RESULT_UNSUPPORTED, f"no fence of kind {item.command} here")
        if item.command in CIRCLES:
            centre = _place(seq, item, waypoint_of)
            areas.append(m.FenceArea(keep=keep, corners=_circle(seq, centre, item.parameters[0], keep)))
            seq += 1
            continue
        corners = items[seq : seq + (count or 0)]
        are_alike = all((each.command, integer(each.parameters[0])) == (item.command, count) for each in corners)
        if count is None or count < 3 or len(corners) < count or not are_alike:
            raise ItemError(seq, RESULT_INVALID, "its polygon has not all its corners")
        places = tuple(_place(seq + n, corner, waypoint_of) for n, corner in enumerate(corners))
        areas.append(m.FenceArea(keep=keep, corners=places))
        seq += count
    return tuple(areas)


def points_of_items(items: Sequence[Item], waypoint_of: WaypointOf) -> tuple[m.Waypoint, ...]:
    """The rally points; their altitude and what else is for wings is passed over. Raises ItemError."""
    points: list[m.Waypoint] = []
    for seq, item in enumerate(items):
        if item.command != dialect.MAV_CMD_NAV_RALLY_POINT:
            raise ItemError(seq, RESULT_UNSUPPORTED, f"command {item.command} is no rally point")
        points.append(_place(seq, item, waypoint_of))
    return tuple(points)


class _LegBuilder:
    """`end`: where the leg before ends, if that is known, from which a route of one waypoint leads on."""

    def __init__(self, waypoint_of: WaypointOf) -> None:
        self.legs: list[m.MissionLeg] = []
        self.seq_of: dict[tuple[int, int], int] = {}
        self._waypoint_of = waypoint_of
        self._run: list[tuple[m.Waypoint, int]] = []
        self._end: tuple[m.Waypoint, int] | None = None
        self._home: tuple[m.Waypoint, ...] = ()
        self._speed_mps = 0.0

    def add(self, seq: int, item: Item) -> None:
        first, second, third, _ = item.parameters
        match item.command:
            case dialect.MAV_CMD_NAV_WAYPOINT if seq == 0 and item.frame in HOME_FRAMES:
                if item.place_e7 != NOWHERE:
                    self._home = (_place(seq, item, self._waypoint_of),)
            case dialect.MAV_CMD_NAV_WAYPOINT:
                here = _place(seq, item, self._waypoint_of)
                self._run.append((here, seq))
                if first > 0.0:
                    self.end_route()
                    self._add_station(seq, (here,), third, first)
            case dialect.MAV_CMD_DO_CHANGE_SPEED:
                self._change_speed(seq, second)
            case dialect.MAV_CMD_DO_JUMP:
                self._repeat(seq, integer(first), integer(second))
            case dialect.MAV_CMD_NAV_LOITER_UNLIM | dialect.MAV_CMD_NAV_LOITER_TIME:
                is_timed = item.command == dialect.MAV_CMD_NAV_LOITER_TIME
                if is_timed and not first > 0.0:
                    raise ItemError(seq, dialect.MAV_MISSION_INVALID_PARAM1, "for how long?")
                self.end_route()
                spot = () if item.place_e7 == NOWHERE else (_place(seq, item, self._waypoint_of),)
                self._add_station(seq, spot, third, first if is_timed else 0.0)
            case dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH:
                self.end_route()
                spot = () if item.place_e7 == NOWHERE else (_place(seq, item, self._waypoint_of),)
                self._add(seq, m.MissionLeg(kind=m.LegKind.RETURN_HOME, waypoints=spot or self._home))
            case dialect.MAV_CMD_DO_SET_MODE if integer(second) == Mode.HOLD:
                self.end_route()
                self._add(seq, m.MissionLeg(kind=m.LegKind.STOP))
            case _:
                raise ItemError(seq, RESULT_UNSUPPORTED, f"the boat cannot do command {item.command}")

    def _change_speed(self, seq: int, wanted_mps: float) -> None:
        if wanted_mps == KEEP_SPEED or math.isnan(wanted_mps):
            return
        if not wanted_mps > 0.0 and wanted_mps != DEFAULT_SPEED:
            raise ItemError(seq, dialect.MAV_MISSION_INVALID_PARAM2, f"{wanted_mps:g} is no speed")
        speed_mps = max(wanted_mps, 0.0)  # the navigator's own is 0
        if speed_mps != self._speed_mps:
            self.end_route()
            self._speed_mps = speed_mps

    def end_route(self) -> None:
        """The waypoints in a row so far are a route, which begins where the leg before ends."""
        if not self._run:
            return
        begun = [] if self._end is None or _is_same(self._end[0], self._run[0][0]) else [self._end]
        self._add_route([*begun, *self._run], repeat=False, laps=1)

    def _repeat(self, seq: int, target: int | None, times: int | None) -> None:
        if len(self._run) < 2 or target != self._run[0][1] or times is None or times == 0 or times < -1:
            raise ItemError(seq, RESULT_UNSUPPORTED, "only back to the first of its waypoints")
        self._add_route(self._run, repeat=True, laps=times + 1)
        self._end = None

    def _add_route(self, run: list[tuple[m.Waypoint, int]], *, repeat: bool, laps: int) -> None:
        self._run = []
        self._end = run[-1]
        if len(run) == 1:
            self._add_station(run[0][1], (run[0][0],), math.nan, PASSING_S)
            return
        self.seq_of.update({(len(self.legs), number): seq for number, (_, seq) in enumerate(run)})
        waypoints = tuple(waypoint for waypoint, _ in run)
        self._append(m.MissionLeg(kind=m.LegKind.FOLLOW_ROUTE, waypoints=waypoints, repeat=repeat, laps=laps))

    def _add_station(self, seq: int, spot: tuple[m.Waypoint, ...], radius_m: float, duration_s: float) -> None:
        radius_m = max(abs(radius_m), MIN_RADIUS_M) if math.isfinite(radius_m) and radius_m != 0.0 else STATION_RADIUS_M
        station = m.MissionLeg(kind=m.LegKind.HOLD_STATION, waypoints=spot, radius_m=radius_m, duration_s=duration_s)
        self._add(seq, station)

    def _add(self, seq: int, leg: m.MissionLeg) -> None:
        self.seq_of[len(self.legs), 0] = seq
        self._end = (leg.waypoints[0], seq) if leg.waypoints else None
        self._append(leg)

    def _append(self, leg: m.MissionLeg) -> None:
        speed_mps = 0.0 if leg.kind is m.LegKind.STOP else self._speed_mps
        self.legs.append(replace(leg, speed_mps=speed_mps))


def _is_same(one: m.Waypoint, other: m.Waypoint) -> bool:
    return math.dist((one.x_m, one.y_m), (other.x_m, other.y_m)) < MIN_LEG_M


def _place(seq: int, item: Item, waypoint_of: WaypointOf) -> m.Waypoint:
    """The place of an item on the map. Raises ItemError for one that has none on Earth."""
    if item.frame not in PLACE_FRAMES:
        raise ItemError(seq, RESULT_FRAME, f"frame {item.frame} is not latitude and longitude")
    latitude_e7, longitude_e7 = item.place_e7
    if item.place_e7 == NOWHERE or abs(latitude_e7) > 900_000_000 or abs(longitude_e7) > 1_800_000_000:
        raise ItemError(seq, RESULT_PLACE, "has no place")
    return waypoint_of(item.place_e7)


def _circle(seq: int, centre: m.Waypoint, radius_m: float, keep: m.Keep) -> tuple[m.Waypoint, ...]:
    if not MIN_RADIUS_M <= radius_m <= 1e6:
        raise ItemError(seq, dialect.MAV_MISSION_INVALID_PARAM1, "its radius is below a metre, or too large")
    if keep is m.Keep.OUT:
        radius_m /= math.cos(math.pi / CIRCLE_CORNERS)
    turns = (math.tau * number / CIRCLE_CORNERS for number in range(CIRCLE_CORNERS))
    return tuple(
        m.Waypoint(x_m=centre.x_m + radius_m * math.cos(turn), y_m=centre.y_m + radius_m * math.sin(turn))
        for turn in turns
    )
