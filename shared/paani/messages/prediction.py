"""Where the boat will go by the order in force, and what moves around it, in the map: for people to look at."""

from __future__ import annotations

from enum import StrEnum

import msgspec

from paani.messages.ais import Mmsi
from paani.messages.depth import SoundingStatus
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

    track_id: the advisor's track, 0 without one. mmsi: of a vessel that told of itself by AIS, where the camera does
    not look; 0 of what was seen. is_scanned: met by the beams of a range scanner, and no track of the camera's.
    velocity_std_mps: standard deviation, of a person who may swim alone. age_s: since it was last seen; within that
    time its place is predicted.
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
    mmsi: Mmsi = 0
    is_scanned: bool = False


class Constraint(StrEnum):
    """Why the local planner refuses a heading at a speed; the first that does is told. NONE: nothing refuses it.

    PERSON, STATIC_OBSTACLE, DYNAMIC_OBSTACLE: too near to one. UNKNOWN_WATER: no room to stop before it. WAIT: the boat
    waits until something has passed. LOOK: it looks where it turns before it moves. NO_ESCAPE: it does not lead out of
    a place where no margin is left. TOO_FAST: beside an obstacle. TURN: too small a pivot, too far round, or not the
    one asked for.
    """

    NONE = "none"
    PERSON = "person"
    STATIC_OBSTACLE = "static_obstacle"
    DYNAMIC_OBSTACLE = "dynamic_obstacle"
    UNKNOWN_WATER = "unknown_water"
    WAIT = "wait"
    LOOK = "look"
    NO_ESCAPE = "no_escape"
    TOO_FAST = "too_fast"
    TURN = "turn"


class HeadingCosts(msgspec.Struct, frozen=True):
    """What a heading costs; the unit is a quarter turn off the course.

    course: off the desired one. progress: made good along it. heading_change: off the plan before. advice: not to the
    advised side. unknown_water: on the path. proximity: to obstacles, and ahead of dynamic ones. path_obstacle: further
    along the path. margin: how far that of what was seen is intruded into. give_way: near to the course of a vessel
    under way. passing_side: such a vessel is left on the other side than courtesy asks for, so that the boat crosses
    its bow, or passes it starboard to starboard. collision: how probably such a vessel strikes the boat.
    """

    course: Finite
    progress: Finite
    heading_change: Finite
    advice: Finite
    unknown_water: Finite
    proximity: Finite
    path_obstacle: Finite
    margin: Finite
    give_way: Finite = 0.0
    passing_side: Finite = 0.0
    collision: Finite = 0.0


class HeadingVerdict(msgspec.Struct, frozen=True, kw_only=True):
    """Why the plan in force took or refused a heading.

    refused_by: at each speed that was tried, the fastest first. speed_mps, costs: of the cheapest speed that nothing
    refuses; 0 and unset where everything is refused.
    """

    heading_rad: Finite
    refused_by: tuple[Constraint, ...]
    speed_mps: NonNegative = 0.0
    costs: HeadingCosts | msgspec.UnsetType = msgspec.UNSET


class Prediction(Message, frozen=True, kw_only=True):
    """`path`: where the boat will be by the order in force, from now on; empty while it may not move.

    `home`: where it would return to; empty before that is known, else one point. Nothing is decided by this message.
    `courtesy`: the nearest encounter in words, and what the order does about it; empty without one.
    `headings`: why each was taken or refused, the desired course first; empty without a plan of the last second.
    `soundings`: what is made of the echo sounder's; `depth_m`: the newest that was believed, 0 before one was.
    """

    path: tuple[Waypoint, ...] = ()
    obstacles: tuple[MovingObstacle, ...] = ()
    home: tuple[Waypoint, ...] = ()
    courtesy: Text = ""
    headings: tuple[HeadingVerdict, ...] = ()
    soundings: SoundingStatus = SoundingStatus.OFF
    depth_m: NonNegative = 0.0
