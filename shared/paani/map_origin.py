"""Where the map's origin lies on Earth, as the estimate has it. Pure."""

from __future__ import annotations

import math

from paani.geometry import geodetic_from_enu
from paani.messages import Odometry


def map_origin_deg(pose: Odometry) -> tuple[float, float]:
    """Latitude and longitude of the map's origin [deg], from where a pose lies in both."""
    latitude_deg, longitude_deg = pose.latitude_deg, pose.longitude_deg
    for _ in range(3):  # each step takes out all but the curvature's change over the way to the origin
        found = geodetic_from_enu(pose.x_m, pose.y_m, latitude_deg, longitude_deg)
        latitude_deg += pose.latitude_deg - found[0]
        longitude_deg += math.remainder(pose.longitude_deg - found[1], 360.0)
    return latitude_deg, longitude_deg
