"""Moving obstacles around the boat as OBSTACLE_DISTANCE, and the one that comes nearest as COLLISION. Pure.

Sectors of five degrees, clockwise from the bow. A sector in which no moving obstacle is tracked is not known to be
free: it has the protocol's value for what is not known.
"""

from __future__ import annotations

import math
from typing import Any

import msgspec

from paani import messages as m
from paani.geometry import wrap_rad
from paani_services.mavlink.codec import dialect
from paani_services.mavlink.fields import U16_MAX, U32_MAX, to_int
from paani_services.mavlink.snapshot import Snapshot

SECTORS = 72
SECTOR_RAD = 2.0 * math.pi / SECTORS
MAX_DISTANCE_M = 100.0
FIRST_ID = 256  # of COLLISION, which has those of MAVLink systems below


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


def collision(snapshot: Snapshot) -> Any | None:
    """Of the obstacles that come nearer by the present velocities of both, the one that will come nearest.

    None where nothing does, or the prediction is not known. The threat is high from when the navigator finds the
    closest point too near until the two are past it.
    """
    found = [] if snapshot.prediction is None else [_approach_of(each) for each in snapshot.prediction.obstacles]
    approaches = [each for each in found if each is not None]
    if not approaches:
        return None
    cpa_m, tcpa_s, track_id, is_encounter = min(approaches)
    return dialect.MAVLink_collision_message(
        dialect.MAV_COLLISION_SRC_MAVLINK_GPS_GLOBAL_INT,
        (FIRST_ID + track_id) & U32_MAX,
        dialect.MAV_COLLISION_ACTION_REPORT,
        dialect.MAV_COLLISION_THREAT_LEVEL_HIGH if is_encounter else dialect.MAV_COLLISION_THREAT_LEVEL_LOW,
        tcpa_s,
        0.0,
        cpa_m,
    )


def _approach_of(obstacle: m.MovingObstacle) -> tuple[float, float, int, bool] | None:
    """Distance and time of the closest point, track, whether that is too near; None where it is past, or unknown."""
    cpa_m, tcpa_s = obstacle.cpa_m, obstacle.tcpa_s
    if cpa_m is msgspec.UNSET or tcpa_s is msgspec.UNSET or tcpa_s <= 0.0:
        return None
    return cpa_m, tcpa_s, obstacle.track_id, obstacle.encounter is not m.EncounterClass.NONE


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
