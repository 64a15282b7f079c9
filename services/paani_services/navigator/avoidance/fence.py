"""The fence under way: how fast the boat may go towards an edge. Pure."""

import itertools
import math

from paani import portable
from paani.config import NavigatorConfig
from paani.fence_geometry import Fence, Point, allowed_distance_m, is_allowed, return_bearing_rad
from paani.geometry import wrap_rad
from paani.messages import Odometry
from paani_services.navigator.guidance.path_progress import velocity_over_ground_mps

MIN_COURSE_SPEED_MPS = 0.1  # speed below which the course over ground is noise [m/s]
MIN_ORDERED_SPEED_MPS = 0.05  # a slower order would not move the boat [m/s]
RETURN_SECTOR_RAD = math.radians(60.0)  # a heading this far off the nearest way in still leads in [rad]


def limit_speed(
    fence: Fence,
    odometry: Odometry,
    heading_rad: float,
    speed_mps: float,
    config: NavigatorConfig,
    *,
    is_astern: bool = False,
) -> float | None:
    """The speed at which the ordered heading may be sailed, or None where the boat may not move.

    is_astern: whether the boat is to go there stern first.

    The speed is limited so that `fence_margin_m` and the stopping distance (`fence_stop_s` times the speed) fit before
    the edge along the ordered heading. A boat that would come to the edge within `fence_stop_s` at a velocity that it
    may have by the next order gets no thrust. Outside the fence nothing moves, unless `fence_return` is set and the
    heading leads to the nearest way in.
    """
    if not fence:
        return speed_mps
    here = (odometry.x_m, odometry.y_m)
    if not is_allowed(fence, here):
        return _limit_speed_outside(fence, here, heading_rad, speed_mps, config)
    # Round all the water on which it may come to rest.
    way = (here, *_stopping_places(odometry, config, is_astern=is_astern), here)
    if any(allowed_distance_m(fence, start, end) < math.inf for start, end in itertools.pairwise(way)):
        return None
    reach_m = config.fence_margin_m + speed_mps * config.fence_stop_s
    ahead = (here[0] + reach_m * portable.cos(heading_rad), here[1] + reach_m * portable.sin(heading_rad))
    allowed_mps = (allowed_distance_m(fence, here, ahead) - config.fence_margin_m) / config.fence_stop_s
    return min(speed_mps, allowed_mps) if allowed_mps >= min(MIN_ORDERED_SPEED_MPS, speed_mps) else None


def _stopping_places(odometry: Odometry, config: NavigatorConfig, *, is_astern: bool) -> tuple[Point, ...]:
    """Where it is after `fence_stop_s` if it turns until the next order: to starboard, not at all, to port."""
    east_mps, north_mps = _velocity_at_next_order(odometry, config, is_astern=is_astern)
    turn_rad = config.planner.yaw_rate_radps / config.rate_hz
    places = []
    for angle_rad in (-turn_rad, 0.0, turn_rad):
        sin, cos = portable.sin(angle_rad), portable.cos(angle_rad)
        ahead_mps = east_mps * cos - north_mps * sin, east_mps * sin + north_mps * cos
        places.append(
            (odometry.x_m + ahead_mps[0] * config.fence_stop_s, odometry.y_m + ahead_mps[1] * config.fence_stop_s)
        )
    return tuple(places)


def _velocity_at_next_order(odometry: Odometry, config: NavigatorConfig, *, is_astern: bool) -> tuple[float, float]:
    """East and north velocity that the boat may have by the next order [m/s].

    Thrust drives the boat along its present heading, or astern of it, whatever heading is ordered, until it has turned.
    A velocity whose direction is noise counts as its part in that direction.
    """
    east_mps, north_mps = velocity_over_ground_mps(odometry)
    gain_mps, sense = config.planner.accel_mps2 / config.rate_hz, -1.0 if is_astern else 1.0
    if math.hypot(east_mps, north_mps) <= MIN_COURSE_SPEED_MPS:
        east_mps, north_mps, gain_mps = 0.0, 0.0, gain_mps + max(sense * odometry.surge_mps, 0.0)
    gain_mps *= sense
    return (
        east_mps + gain_mps * portable.cos(odometry.yaw_rad),
        north_mps + gain_mps * portable.sin(odometry.yaw_rad),
    )


def _limit_speed_outside(
    fence: Fence, here: Point, heading_rad: float, speed_mps: float, config: NavigatorConfig
) -> float | None:
    """The ordered speed, if `fence_return` is set and the heading leads to the nearest way in; else None."""
    back_rad = return_bearing_rad(fence, here) if config.fence_return else None
    if back_rad is None or abs(wrap_rad(heading_rad - back_rad)) > RETURN_SECTOR_RAD:
        return None
    return speed_mps
