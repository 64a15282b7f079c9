"""What a world is: water, route, things in the way, wind and light. Values only.

Map frame is local ENU (x east, y north, z up, the water surface is z = 0), metres and radians.
"""

from dataclasses import dataclass, field
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from paani_sim.worlds.curves import Points, closed_length_m, point_along_closed


class Kind(StrEnum):
    """What a thing is; the first four are the detector's classes in its order (checklist C2)."""

    PERSON = "person"
    VESSEL = "vessel"
    PIER = "pier"
    BUOY = "buoy"
    OTHER = "other"


class Pose2(NamedTuple):
    """Position and heading in the plane, `yaw_rad` counter-clockwise from east."""

    x_m: float
    y_m: float
    yaw_rad: float


@dataclass(frozen=True)
class Obstacle:
    """A thing that does not move. `length_m` lies along its yaw; `base_z_m` is its foot."""

    id: str
    kind: Kind
    look: str
    pose: Pose2
    length_m: float
    width_m: float
    height_m: float
    base_z_m: float = 0.0
    variant: int = 0

    @property
    def radius_m(self) -> float:
        """Radius of the circle around the footprint."""
        return 0.5 * float(np.hypot(self.length_m, self.width_m))


@dataclass(frozen=True, eq=False)
class Actor:
    """A thing that runs round a closed path `(n, 2)` at a constant speed."""

    id: str
    kind: Kind
    look: str
    path_m: Points
    speed_mps: float
    length_m: float
    width_m: float
    height_m: float
    start_m: float = 0.0
    variant: int = 0


@dataclass(frozen=True)
class Wind:
    """Mean wind. `toward_rad` is where it blows to, counter-clockwise from east."""

    speed_mps: float = 2.0
    toward_rad: float = 0.6


@dataclass(frozen=True)
class Light:
    """Sky and sun. `sky` is one of clear, cloudy, overcast, dusk, hazy."""

    sky: str = "cloudy"
    sun_azimuth_rad: float = 2.2
    sun_elevation_rad: float = 0.7
    visibility_m: float = 900.0
    seed: int = 1


@dataclass(frozen=True, eq=False)
class World:
    """One world. `shore_m` is the water's edge as one closed polygon, counter-clockwise.

    `route_m` `(n, 2)` is closed: its last waypoint leads back to the first.
    `start` lies on the route and heads along it. `water_rgb` is the colour of the water's body
    (display values), `season_frac` runs from summer green (0) to autumn (1).
    """

    name: str
    seed: int
    origin_lat_deg: float
    origin_lon_deg: float
    shore_m: Points
    route_m: Points
    start: Pose2
    obstacles: tuple[Obstacle, ...]
    actors: tuple[Actor, ...]
    wind: Wind = field(default_factory=Wind)
    light: Light = field(default_factory=Light)
    water_rgb: tuple[float, float, float] = (0.30, 0.34, 0.22)
    season_frac: float = 0.2

    @property
    def route_length_m(self) -> float:
        """Length of one lap."""
        return closed_length_m(self.route_m)


def actor_pose(actor: Actor, t_s: float) -> Pose2:
    """Where the actor is at simulated time `t_s`; heading along its path, turned smoothly."""
    along_m = actor.start_m + actor.speed_mps * t_s
    x_m, y_m, _ = point_along_closed(actor.path_m, along_m)
    reach_m = 0.5 * actor.length_m
    ahead = point_along_closed(actor.path_m, along_m + reach_m)
    behind = point_along_closed(actor.path_m, along_m - reach_m)
    return Pose2(x_m, y_m, float(np.arctan2(ahead[1] - behind[1], ahead[0] - behind[0])))
