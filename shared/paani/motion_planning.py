"""What a motion planner is given and gives: the seam at which another planner takes the place of the navigator's own.

Lockstep trials put planners of the literature there, on the same map and tracks. The live navigator has its own alone.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from paani.arrays import F64, Bools


class MovingObstacle(NamedTuple):
    """A tracked obstacle: points of its outline now, in the map's axes `(n,)` [m], and its velocity [m/s]."""

    east_m: F64
    north_m: F64
    velocity_east_mps: float
    velocity_north_mps: float


class PlanningInputs(NamedTuple):
    """The boat, what it is asked to do, and what is known around it.

    occupied: cells `[north, east]` of `cell_m`, the map's corner at `west_m`, `south_m`; what moves is not on it.
    course_rad, speed_mps: asked for by guidance; the speed is the highest allowed. Angles are counter-clockwise from
    east. previous_heading_rad: of the plan before, None where there was none.
    """

    x_m: float
    y_m: float
    yaw_rad: float
    surge_mps: float
    yaw_rate_radps: float
    course_rad: float
    speed_mps: float
    previous_heading_rad: float | None
    occupied: Bools
    west_m: float
    south_m: float
    cell_m: float
    moving: tuple[MovingObstacle, ...]


class HeadingSpeed(NamedTuple):
    """The heading [rad] and speed [m/s] to order; 0 stops the boat."""

    heading_rad: float
    speed_mps: float


MotionPlanner = Callable[[PlanningInputs], HeadingSpeed]
