"""The mission: what the boat is to do, leg by leg, and the fence that it may not leave."""

from __future__ import annotations

from enum import StrEnum

import msgspec

from paani.messages.guidance import Waypoint
from paani.messages.header import Count, Message, NonNegative, Stamp, Text


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
    """The legs in order, the fence, the land, and where home is.

    The boat stays inside at least one of the areas that keep in, if there are any, and outside all that keep out.
    `land`: of the boat's files, kept out of likewise; no client changes it.
    `rally`: places that RETURN may lead to where they are nearer than home. Without legs there is nothing to do.
    `home`: the one place that the boat's files name; empty: where the boat was first free to move.
    `accepted_us`: when the operator's process accepted it, which is its name among the missions of a run; 0: of the
    boat's files. `legs_us`: the same of the mission that these legs were
    accepted with; a fence or rally points that come later begin no leg anew.
    """

    name: Text
    legs: tuple[MissionLeg, ...]
    fence: tuple[FenceArea, ...] = ()
    rally: tuple[Waypoint, ...] = ()
    accepted_us: Stamp = 0
    legs_us: Stamp = 0
    home: tuple[Waypoint, ...] = ()
    land: tuple[FenceArea, ...] = ()

    @property
    def bounds(self) -> tuple[FenceArea, ...]:
        """Fence and land: everything that the boat is kept in and out of."""
        return (*self.fence, *self.land)


class MissionRequest(Message, frozen=True, kw_only=True):
    """Legs, a fence, rally points, or all of them, that a client asks the operator's process to put in force.

    `press`: a number of its own for each request, the same while it is said again. `hand`: whose of the client it is.
    `keep_legs`, `keep_fence`, `keep_rally`: those in force stay, whatever stands here.
    """

    press: Count
    hand: Count = 0
    name: Text = ""
    legs: tuple[MissionLeg, ...] = ()
    fence: tuple[FenceArea, ...] = ()
    rally: tuple[Waypoint, ...] = ()
    keep_legs: bool = False
    keep_fence: bool = False
    keep_rally: bool = False


class MissionRefusal(StrEnum):
    """Why a mission was not accepted, so that the one before stays in force; NONE where it was.

    INVALID: the navigator could not take it; the text beside it names the place. UNDER_WAY: the boat is armed in ROUTE,
    where another mission would move it elsewhere. FENCE_IN_USE: the boat is armed in a mode that may move it, which
    another fence could begin. NOT_HOLDER: another hand holds the wheel. NOT_KNOWN: what is to be kept is not known,
    as the navigator is not heard. BUSY: another mission is being checked.
    """

    NONE = "NONE"
    INVALID = "INVALID"
    UNDER_WAY = "UNDER_WAY"
    FENCE_IN_USE = "FENCE_IN_USE"
    NOT_HOLDER = "NOT_HOLDER"
    NOT_KNOWN = "NOT_KNOWN"
    BUSY = "BUSY"
