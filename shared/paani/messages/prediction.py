"""Where the boat will go by the order in force, and what moves around it, in the map: for people to look at."""

from __future__ import annotations

import msgspec

from paani.messages.guidance import Waypoint
from paani.messages.header import Count, Finite, Message, NonNegative


class MovingObstacle(msgspec.Struct, frozen=True, kw_only=True):
    """A dynamic obstacle that the plan in force was made for: its middle now, its half width, and its velocity.

    track_id: the advisor's track. velocity_std_mps: standard deviation, of a person who may swim alone. age_s: since it
    was last seen; within that time its place is predicted.
    """

    track_id: Count
    x_m: Finite
    y_m: Finite
    radius_m: NonNegative
    east_mps: Finite
    north_mps: Finite
    velocity_std_mps: NonNegative = 0.0
    age_s: NonNegative = 0.0


class Prediction(Message, frozen=True, kw_only=True):
    """`path`: where the boat will be by the order in force, from now on; empty while it may not move.

    `home`: where it would return to; empty before that is known, else one point. Nothing is decided by this message.
    """

    path: tuple[Waypoint, ...] = ()
    obstacles: tuple[MovingObstacle, ...] = ()
    home: tuple[Waypoint, ...] = ()
