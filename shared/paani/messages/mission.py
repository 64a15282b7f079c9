"""The mission: what the boat is to do, leg by leg, and the fence that it may not leave."""

from __future__ import annotations

from enum import StrEnum

import msgspec

from paani.messages.guidance import Waypoint
from paani.messages.header import Count, Message, NonNegative, Text


class LegKind(StrEnum):
    """What one leg of a mission asks for."""

    FOLLOW_ROUTE = "follow_route"
    HOLD_STATION = "hold_station"
    RETURN_HOME = "return_home"
    STOP = "stop"


class MissionLeg(msgspec.Struct, frozen=True, kw_only=True):
    """One leg, in the map frame.

    `waypoints`: for FOLLOW_ROUTE the route in the order in which it is followed; for HOLD_STATION the station, without
    it where the leg began; for RETURN_HOME home, without it where the boat was first armed and free to move.
    `repeat`: the last waypoint leads back to the first, `laps` times, 0 without end. `radius_m`: of the station.
    `duration_s`: time on station, 0 until the operator stops the boat and arms it again. `speed_mps` 0: cruise.
    """

    kind: LegKind
    waypoints: tuple[Waypoint, ...] = ()
    repeat: bool = False
    laps: Count = 1
    radius_m: NonNegative = 0.0
    duration_s: NonNegative = 0.0
    speed_mps: NonNegative = 0.0


class Keep(StrEnum):
    """Whether an area keeps the boat in or out."""

    IN = "in"
    OUT = "out"


class FenceArea(msgspec.Struct, frozen=True, kw_only=True):
    """An area of the fence: a polygon of the map whose edges do not cross; the last corner leads back to the first."""

    keep: Keep
    corners: tuple[Waypoint, ...]
    name: Text = ""


class Mission(Message, frozen=True, kw_only=True):
    """The legs in order, and the fence.

    The boat stays inside at least one of the areas that keep in, if there are any, and outside all that keep out.
    """

    name: Text
    legs: tuple[MissionLeg, ...]
    fence: tuple[FenceArea, ...] = ()
