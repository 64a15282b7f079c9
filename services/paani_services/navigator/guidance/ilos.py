"""Steering up against wind and current: the part of line of sight that remembers.

Integral line of sight of Borhaug, Pavlov and Pettersen, "Integral LOS control for path following of underactuated
marine surface vessels in the presence of constant ocean currents", CDC 2008: the course is that to a point
`lookahead_m` ahead and `y + s` abeam, and s grows with sigma L y / ((y + s)^2 + L^2), which slows down far from the
line by itself. Here s is the part across the leg of a vector in the map frame: what pushes the boat comes from
one side of the map, so what was learned on one leg holds on the next as far as it points the same way.
Nothing is learned while the boat is closing in on its line anyway: a distance that is on its way out is no drift.
"""

import math

import msgspec

from paani import portable
from paani.config import NavigatorConfig
from paani.geometry import clip
from paani.messages import Odometry
from paani_services.navigator.guidance.path_progress import Track, leg_start, over_ground_mps

CLOSING_MPS = 0.1  # the integral alone brings the boat back slower
MAX_STEP_S = 0.3  # a longer gap since the last lesson counts as this long


class Crab(msgspec.Struct, frozen=True):
    """What has been learned [m], towards east and north, and when last [us]."""

    east_m: float = 0.0
    north_m: float = 0.0
    at_us: int = 0


def offset_m(crab: Crab, track: Track, target: int) -> float:
    """The part of it to the left of the leg."""
    left_x, left_y = _left(track, target)
    return crab.east_m * left_x + crab.north_m * left_y


def learned(
    crab: Crab, track: Track, target: int, cross_m: float, odometry: Odometry, now_us: int, config: NavigatorConfig
) -> Crab:
    """One step of the integral at `cross_m` left of the leg, bounded by `max_crab_deg`."""
    left_x, left_y = _left(track, target)
    east_mps, north_mps = over_ground_mps(odometry)
    if -math.copysign(1.0, cross_m) * (east_mps * left_x + north_mps * left_y) > CLOSING_MPS:
        return paused(crab, now_us)
    lookahead_m = config.lookahead_m
    step_s = clip((now_us - crab.at_us) * 1e-6, 0.0, MAX_STEP_S) if crab.at_us else 0.0
    aside_m = cross_m + offset_m(crab, track, target)
    grown_m = step_s * config.crab_gain_mps * lookahead_m * cross_m / (aside_m * aside_m + lookahead_m * lookahead_m)
    east_m, north_m = crab.east_m + grown_m * left_x, crab.north_m + grown_m * left_y
    most_m, length_m = lookahead_m * portable.tan(math.radians(config.max_crab_deg)), math.hypot(east_m, north_m)
    if length_m > most_m:
        east_m, north_m = east_m * most_m / length_m, north_m * most_m / length_m
    return Crab(east_m, north_m, now_us)


def paused(crab: Crab, now_us: int) -> Crab:
    """Nothing is learned from the time until now."""
    return Crab(crab.east_m, crab.north_m, now_us)


def _left(track: Track, target: int) -> tuple[float, float]:
    """Unit vector to the left of the leg."""
    start = leg_start(track, target)
    end = track.waypoints[target]
    along_x, along_y = end.x_m - start.x_m, end.y_m - start.y_m
    length_m = math.hypot(along_x, along_y)
    return -along_y / length_m, along_x / length_m
