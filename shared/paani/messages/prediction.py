"""Where the boat will go by the order in force, and what moves around it, in the map: for people to look at."""

from __future__ import annotations

from enum import StrEnum

import msgspec

from paani.messages.guidance import Waypoint
from paani.messages.header import Count, Finite, Message, NonNegative, Text


class EncounterClass(StrEnum):
    """How two vessels meet (COLREGs 1972, rules 13 to 15). NONE: none of these rules speaks of it.

    CROSSING_STARBOARD and CROSSING_PORT: the other one comes from that side of ours.
    """

    OVERTAKEN = "overtaken"
    OVERTAKING = "overtaking"
    HEAD_ON = "head_on"
    CROSSING_STARBOARD = "crossing_starboard"
    CROSSING_PORT = "crossing_port"
    NONE = "none"


class MovingObstacle(msgspec.Struct, frozen=True, kw_only=True):
    """A dynamic obstacle that the plan in force was made for: its middle now, its half width, and its velocity.

    track_id: the advisor's track. velocity_std_mps: standard deviation, of a person who may swim alone. age_s: since it
    was last seen; within that time its place is predicted.
    tcpa_s, cpa_m: when, by the present velocities of both, its outline will be nearest to the boat's middle, and how
    near; cpa_std_m: standard deviation of that. Unset where they were not computed.
    encounter: how the two meet, from when their closest point is too near until they are past it.
    """

    track_id: Count
    x_m: Finite
    y_m: Finite
    radius_m: NonNegative
    east_mps: Finite
    north_mps: Finite
    velocity_std_mps: NonNegative = 0.0
    age_s: NonNegative = 0.0
    cpa_m: NonNegative | msgspec.UnsetType = msgspec.UNSET
    cpa_std_m: NonNegative | msgspec.UnsetType = msgspec.UNSET
    tcpa_s: NonNegative | msgspec.UnsetType = msgspec.UNSET
    encounter: EncounterClass = EncounterClass.NONE


class Prediction(Message, frozen=True, kw_only=True):
    """`path`: where the boat will be by the order in force, from now on; empty while it may not move.

    `home`: where it would return to; empty before that is known, else one point. Nothing is decided by this message.
    `courtesy`: the nearest encounter in words, and what the order does about it; empty without one.
    """

    path: tuple[Waypoint, ...] = ()
    obstacles: tuple[MovingObstacle, ...] = ()
    home: tuple[Waypoint, ...] = ()
    courtesy: Text = ""
