"""Where the map's origin lies on Earth, as the estimate has it. Pure."""

from __future__ import annotations

import math

import msgspec

from paani.geometry import enu_from_geodetic, geodetic_from_enu
from paani.messages import Odometry, OperatorOrder

MAP_MOVED_M = 2.0  # of one map the origin is found to the millimetre; two starts of a receiver differ by metres


class MapPlace(msgspec.Struct, frozen=True):
    """One place in the map and on Earth, by which the map is known again."""

    x_m: float
    y_m: float
    latitude_deg: float
    longitude_deg: float


def map_place_of(pose: Odometry | None) -> MapPlace | None:
    """Where an estimate that may be believed has the boat; None without one, and where it does not say so on Earth."""
    if pose is None or not pose.healthy or (pose.latitude_deg, pose.longitude_deg) == (0.0, 0.0):
        return None
    return MapPlace(pose.x_m, pose.y_m, pose.latitude_deg, pose.longitude_deg)


def map_place_of_order(order: OperatorOrder) -> MapPlace | None:
    """The origin of the map in which the order's target and mission were placed; None where it does not say."""
    latitude_deg, longitude_deg = order.map_latitude_deg, order.map_longitude_deg
    return MapPlace(0.0, 0.0, latitude_deg, longitude_deg) if (latitude_deg, longitude_deg) != (0.0, 0.0) else None


def is_map_moved(known: MapPlace | None, now: MapPlace | None) -> bool:
    """Whether the map lies elsewhere on Earth than it did: what was placed in it then is not where it was."""
    if known is None or now is None:
        return False
    return math.hypot(*enu_from_geodetic(*map_origin_deg(now), *map_origin_deg(known))) > MAP_MOVED_M


def map_origin_deg(pose: Odometry | MapPlace) -> tuple[float, float]:
    """Latitude and longitude of the map's origin [deg], from where a pose lies in both."""
    latitude_deg, longitude_deg = pose.latitude_deg, pose.longitude_deg
    for _ in range(3):  # each step takes out all but the curvature's change over the way to the origin
        found = geodetic_from_enu(pose.x_m, pose.y_m, latitude_deg, longitude_deg)
        latitude_deg += pose.latitude_deg - found[0]
        longitude_deg += math.remainder(pose.longitude_deg - found[1], 360.0)
    return latitude_deg, longitude_deg
