"""Moving obstacles around the boat as OBSTACLE_DISTANCE. Pure.

Sectors of five degrees, clockwise from the bow. A sector in which no moving obstacle is tracked is not known to be
free: it has the protocol's value for what is not known.
"""

from __future__ import annotations

import math
from typing import Any

from paani import messages as m
from paani.geometry import wrap_rad
from paani_services.mavlink.codec import dialect
from paani_services.mavlink.fields import U16_MAX, to_int
from paani_services.mavlink.snapshot import Snapshot

SECTORS = 72
SECTOR_RAD = 2.0 * math.pi / SECTORS
MAX_DISTANCE_M = 100.0


def obstacle_distance(snapshot: Snapshot) -> Any | None:
    """The obstacles that the plan in force was made for; None while the pose or the prediction is not known."""
    pose, prediction = snapshot.pose, snapshot.prediction
    if pose is None or prediction is None:
        return None
    distances_cm = [U16_MAX] * SECTORS
    for obstacle in prediction.obstacles:
        distance_m, sectors = sectors_of(obstacle, pose)
        if distance_m <= MAX_DISTANCE_M:
            for sector in sectors:
                distances_cm[sector] = min(distances_cm[sector], to_int(distance_m * 100.0, 0, U16_MAX - 1))
    return dialect.MAVLink_obstacle_distance_message(
        prediction.source_us,
        dialect.MAV_DISTANCE_SENSOR_UNKNOWN,
        distances_cm,
        round(math.degrees(SECTOR_RAD)),
        0,
        round(MAX_DISTANCE_M * 100.0),
        frame=dialect.MAV_FRAME_BODY_FRD,
    )


def sectors_of(obstacle: m.MovingObstacle, pose: m.Odometry) -> tuple[float, list[int]]:
    """Distance from the boat to the obstacle's edge [m], and the sectors that it covers; all if the boat is in it."""
    east_m, north_m = obstacle.x_m - pose.x_m, obstacle.y_m - pose.y_m
    middle_m = math.hypot(east_m, north_m)
    if middle_m <= obstacle.radius_m:
        return 0.0, list(range(SECTORS))
    bearing_rad = wrap_rad(pose.yaw_rad - math.atan2(north_m, east_m))
    half_rad = math.asin(obstacle.radius_m / middle_m)
    first, last = (math.floor((bearing_rad + side * half_rad) / SECTOR_RAD + 0.5) for side in (-1.0, 1.0))
    return middle_m - obstacle.radius_m, [sector % SECTORS for sector in range(first, last + 1)]
