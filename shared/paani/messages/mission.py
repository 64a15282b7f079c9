"""What the boat is to do, leg by leg, and where it may not go."""

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

    waypoints: of FOLLOW_ROUTE the line in the order sailed (`repeat`: the last leads back to the first, and
    `laps` 0 has no end); of HOLD_STATION the place, of RETURN_HOME home. None of these two: where the leg began,
    and where the boat was armed first. `duration_s` 0: until the operator stops the boat and arms it again.
    `speed_mps` 0: cruise.
    """

    kind: LegKind
    waypoints: tuple[Waypoint, ...] = ()
    repeat: bool = False
    laps: Count = 1
    radius_m: NonNegative = 0.0
    duration_s: NonNegative = 0.0
    speed_mps: NonNegative = 0.0


class Keep(StrEnum):
    """On which side of its edge an area keeps the boat."""

    IN = "in"
    OUT = "out"


class FenceArea(msgspec.Struct, frozen=True, kw_only=True):
    """A simple polygon in the map frame; the last corner leads back to the first."""

    keep: Keep
    corners: tuple[Waypoint, ...]
    name: Text = ""


class Mission(Message, frozen=True, kw_only=True):
    """The legs in order and the fence. Where areas keep in, the boat stays inside at least one of them."""

    name: Text
    legs: tuple[MissionLeg, ...]
    fence: tuple[FenceArea, ...] = ()
