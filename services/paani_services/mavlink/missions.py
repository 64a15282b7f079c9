"""Mission, fence and rally points as ground stations download them. Pure.

As ArduPilot has it, item 0 of a mission is home.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from paani import messages as m
from paani.geometry import geodetic_from_enu
from paani.map_origin import map_origin_deg
from paani_services.mavlink.codec import dialect
from paani_services.mavlink.fields import U16_MAX, degrees_e7
from paani_services.mavlink.mission_items import DEFAULT_SPEED, Item, Legs
from paani_services.mavlink.rover_modes import Mode, mode_of
from paani_services.mavlink.snapshot import Snapshot
from paani_services.mavlink.station import Source

MISSION, FENCE, RALLY, ALL = 0, 1, 2, 255  # mission_type
GLOBAL, RELATIVE = dialect.MAV_FRAME_GLOBAL, dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT
WAYPOINT = dialect.MAV_CMD_NAV_WAYPOINT
MAX_ITEMS = 65_000
IN_MISSION, SUSPENDED = 1, 2  # mission_mode
NAN = math.nan

Place = Callable[[m.Waypoint], tuple[int, int]]


class Plan(NamedTuple):
    """What can be downloaded. `seq_of` gives the item that is steered for, by leg and waypoint."""

    items: dict[int, tuple[Item, ...]]
    seq_of: dict[tuple[int, int], int]


EMPTY = Plan({MISSION: (), FENCE: (), RALLY: ()}, {})


class Uploaded(NamedTuple):
    """What a station has uploaded: its items, and the legs that they are."""

    items: tuple[Item, ...]
    legs: Legs


def plan_of(snapshot: Snapshot, uploaded: Uploaded | None = None) -> Plan:
    """Mission, fence and rally points in degrees; empty while either the mission or the boat's own place is not known.

    A mission that was uploaded, and is in force, has the items that were uploaded.
    """
    pose, legs = snapshot.pose, snapshot.legs
    if pose is None or legs is None:
        return EMPTY
    origin_deg = map_origin_deg(pose)

    def place(point: m.Waypoint) -> tuple[int, int]:
        latitude_deg, longitude_deg = geodetic_from_enu(point.x_m, point.y_m, *origin_deg)
        return degrees_e7(latitude_deg), degrees_e7(longitude_deg)

    fence_items = _fence_items(snapshot.fence, place)[:MAX_ITEMS]
    rally_items = tuple(Item(dialect.MAV_CMD_NAV_RALLY_POINT, place_e7=place(point)) for point in snapshot.rally)
    home = snapshot.prediction.home if snapshot.prediction is not None else ()
    if uploaded is not None and uploaded.legs.legs == legs:
        return Plan({MISSION: uploaded.items, FENCE: fence_items, RALLY: rally_items}, uploaded.legs.seq_of)
    items = [Item(WAYPOINT, place_e7=place(home[0]) if home else (0, 0), frame=GLOBAL)]
    seq_of: dict[tuple[int, int], int] = {}
    speed_mps = 0.0
    for number, leg in enumerate(legs):
        if leg.speed_mps != speed_mps:
            speed_mps = leg.speed_mps
            items.append(Item(dialect.MAV_CMD_DO_CHANGE_SPEED, (1.0, speed_mps or DEFAULT_SPEED, -1.0, 0.0)))
        seq_of.update({(number, each): len(items) + each for each in range(max(1, len(leg.waypoints)))})
        items += _leg_items(leg, len(items), place)
    return Plan({MISSION: tuple(items[:MAX_ITEMS]), FENCE: fence_items, RALLY: rally_items}, seq_of)


def _leg_items(leg: m.MissionLeg, first: int, place: Place) -> list[Item]:
    """Items of one leg; `first` is the number of its first. A repetition without end is a jump of -1 times."""
    spot = place(leg.waypoints[0]) if leg.waypoints else (0, 0)
    match leg.kind:
        case m.LegKind.FOLLOW_ROUTE:
            items = [Item(WAYPOINT, (0.0, 0.0, 0.0, NAN), place(point)) for point in leg.waypoints]
            if leg.repeat and leg.laps != 1:
                items.append(Item(dialect.MAV_CMD_DO_JUMP, (float(first), float(leg.laps - 1), 0.0, 0.0)))
            return items
        case m.LegKind.HOLD_STATION if leg.duration_s > 0.0:
            return [Item(dialect.MAV_CMD_NAV_LOITER_TIME, (leg.duration_s, 0.0, leg.radius_m, NAN), spot)]
        case m.LegKind.HOLD_STATION:
            return [Item(dialect.MAV_CMD_NAV_LOITER_UNLIM, (0.0, 0.0, leg.radius_m, NAN), spot)]
        case m.LegKind.RETURN_HOME:
            return [Item(dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH, place_e7=spot)]
        case m.LegKind.STOP:
            return [Item(dialect.MAV_CMD_DO_SET_MODE, (1.0, float(Mode.HOLD), 0.0, 0.0))]


def _fence_items(fence: tuple[m.FenceArea, ...], place: Place) -> tuple[Item, ...]:
    commands = {
        m.Keep.IN: dialect.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION,
        m.Keep.OUT: dialect.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION,
    }
    return tuple(
        Item(commands[area.keep], (float(len(area.corners)), 0.0, 0.0, 0.0), place(corner), GLOBAL)
        for area in fence
        for corner in area.corners
    )


def mission_count(plan: Plan, kind: int, target: Source) -> Any:
    """The answer to a request for the list of a type that there is."""
    return dialect.MAVLink_mission_count_message(*target, len(plan.items[kind]), kind)


def mission_item(plan: Plan, kind: int, seq: int, current: int, target: Source) -> Any | None:
    """The answer to a request for one item; None where there is none of this number."""
    items = plan.items[kind]
    if not 0 <= seq < len(items):
        return None
    item = items[seq]
    is_current = kind == MISSION and seq == current
    return dialect.MAVLink_mission_item_int_message(
        *target, seq, item.frame, item.command, is_current, 1, *item.parameters, *item.place_e7, 0.0, kind
    )


def current_seq(snapshot: Snapshot, plan: Plan) -> int:
    """The item that is steered for; 0 before there is one."""
    command = snapshot.command
    if command is None:
        return 0
    leg = command.leg_index
    return plan.seq_of.get((leg, command.waypoint_index), plan.seq_of.get((leg, 0), 0))


def mission_current(snapshot: Snapshot, plan: Plan) -> Any:
    """How far the mission is."""
    inhibits = snapshot.command.inhibits if snapshot.command is not None else ()
    is_done = m.Inhibit.MISSION_DONE in inhibits or m.Inhibit.ROUTE_FINISHED in inhibits
    items = plan.items[MISSION]
    has_home = bool(items) and (items[0].command, items[0].frame) == (WAYPOINT, GLOBAL)
    total = len(items) - has_home  # the protocol does not count home
    is_route = mode_of(snapshot) is Mode.AUTO
    if snapshot.command is None or (snapshot.legs and not items):
        state = dialect.MISSION_STATE_UNKNOWN
    elif total == 0:
        state = dialect.MISSION_STATE_NO_MISSION
    elif is_done:
        state = dialect.MISSION_STATE_COMPLETE
    elif snapshot.is_armed and is_route:
        state = dialect.MISSION_STATE_ACTIVE
    else:
        state = dialect.MISSION_STATE_PAUSED
    mode = IN_MISSION if is_route else SUSPENDED
    return dialect.MAVLink_mission_current_message(current_seq(snapshot, plan), total or U16_MAX, state, mode)
