"""Values of a world: water, route, obstacles, actors, wind and light.

Map frame is local ENU (x east, y north, z up, the water surface is z = 0), metres and radians.
"""

from dataclasses import dataclass, field
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from paani.arrays import F64
from paani_sim.worlds.curves import closed_length_m, open_length_m, point_along_closed, point_along_open


class Kind(StrEnum):
    """What a thing is; the first four are the detector's classes in its order (C2)."""

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


class Behaviour(StrEnum):
    """How an actor follows its path: at its speed whatever comes; stopping short of a boat that lies across it; or
    hurrying away along it, forward or back, from a boat that comes near."""

    HOLDS_ON = "holds_on"
    GIVES_WAY = "gives_way"
    FLEES = "flees"


@dataclass(frozen=True, eq=False)
class Actor:
    """A thing that runs along a path `(n, 2)` from `start_m` on, beginning at `start_s`.

    A closed path leads from its last point back to its first and has no end; at the end of an open one the actor stays.
    """

    id: str
    kind: Kind
    look: str
    path_m: F64
    speed_mps: float
    length_m: float
    width_m: float
    height_m: float
    start_m: float = 0.0
    variant: int = 0
    closed: bool = True
    start_s: float = 0.0
    behaviour: Behaviour = Behaviour.HOLDS_ON


@dataclass(frozen=True)
class Wind:
    """Mean wind and its gusts. `toward_rad` is where it blows to, counter-clockwise from east.

    Gusts are a first-order Gauss-Markov process: standard deviation `gust_frac` of the mean, time constant `gust_s`.
    """

    speed_mps: float = 2.0
    toward_rad: float = 0.6
    gust_frac: float = 0.0
    gust_s: float = 10.0


@dataclass(frozen=True)
class Waves:
    """Wind sea: JONSWAP, limited by `fetch_m`, of the world's mean wind. Zero fetch: flat water."""

    fetch_m: float = 0.0


@dataclass(frozen=True)
class Current:
    """Mean current in the middle of the water; it falls towards the banks.

    It follows the world's `channel_m` where there is one (downstream is the channel's direction), else `toward_rad`.
    """

    speed_mps: float = 0.0
    toward_rad: float = 0.0


@dataclass(frozen=True)
class Light:
    """Sky, sun and what the air carries. `sky` is one of clear, cloudy, overcast, dusk, hazy.

    `rain_mmph` is the rate of rain [mm/h]. Fog is a short `visibility_m`.
    """

    sky: str = "cloudy"
    sun_azimuth_rad: float = 2.2
    sun_elevation_rad: float = 0.7
    visibility_m: float = 900.0
    seed: int = 1
    rain_mmph: float = 0.0


@dataclass(frozen=True)
class Shoal:
    """A rise of the bottom under water: the cap of an ellipsoid, round from above.

    `radius_m`: at its foot, on the bottom. `top_m`: depth of the water over its middle.
    """

    x_m: float
    y_m: float
    radius_m: float
    top_m: float


class Bank(StrEnum):
    """What the water's edge is made of."""

    GRASS = "grass"
    QUAY = "quay"


@dataclass(frozen=True, eq=False)
class World:
    """One world. `shore_m` is the water's edge as one closed polygon, counter-clockwise.

    `route_m` `(n, 2)`: its last waypoint leads back to the first where `route_closed`.
    `channel_m` `(n, 2)` is the centre line of water that flows, downstream; None for still water.
    `start` lies on the route and heads along it. `water_rgb` is the colour of the water's body
    (display values), `season_frac` runs from summer green (0) to autumn (1).
    `bottom_m` is the depth of the water but for the shoals, which no picture shows. Banks are walls.
    """

    name: str
    seed: int
    origin_lat_deg: float
    origin_lon_deg: float
    shore_m: F64
    route_m: F64
    start: Pose2
    obstacles: tuple[Obstacle, ...]
    actors: tuple[Actor, ...]
    wind: Wind = field(default_factory=Wind)
    light: Light = field(default_factory=Light)
    water_rgb: tuple[float, float, float] = (0.30, 0.34, 0.22)
    season_frac: float = 0.2
    bank: Bank = Bank.GRASS
    route_closed: bool = True
    channel_m: F64 | None = None
    waves: Waves = field(default_factory=Waves)
    current: Current = field(default_factory=Current)
    bottom_m: float = 3.0
    shoals: tuple[Shoal, ...] = ()

    @property
    def route_length_m(self) -> float:
        """Length of one lap, or of the open route."""
        return closed_length_m(self.route_m) if self.route_closed else open_length_m(self.route_m)


def actor_distance_along_m(actor: Actor, t_s: float) -> float:
    """How far along its path the actor is at simulated time `t_s` if it never gives way [m]."""
    return actor.start_m + actor.speed_mps * max(0.0, t_s - actor.start_s)


def actor_pose_along(actor: Actor, along_m: float) -> Pose2:
    """Where the actor is `along_m` down its path; heading along the path, turned smoothly."""
    at = point_along_closed if actor.closed else point_along_open
    x_m, y_m, yaw_rad = at(actor.path_m, along_m)
    reach_m = 0.5 * actor.length_m
    ahead, behind = at(actor.path_m, along_m + reach_m), at(actor.path_m, along_m - reach_m)
    east_m, north_m = ahead[0] - behind[0], ahead[1] - behind[1]
    return Pose2(x_m, y_m, float(np.arctan2(north_m, east_m)) if east_m or north_m else yaw_rad)


def actor_pose_at(actor: Actor, t_s: float) -> Pose2:
    """Where the actor is at simulated time `t_s` if it never gives way."""
    return actor_pose_along(actor, actor_distance_along_m(actor, t_s))
