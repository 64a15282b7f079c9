"""Vessels told by AIS where the camera does not look. Pure.

AIS only ever adds caution: it frees no water, and removes nothing that the camera saw. A position that is metres off
and seconds old refuses no way either, and is no reason to go faster; it is one to leave the vessel's lane in time.
"""

import math
from collections.abc import Sequence

import msgspec
import numpy as np

from paani import portable
from paani.config import CalibrationConfig, PlannerConfig
from paani.geometry import enu_from_geodetic, wrap_rad
from paani.messages import AisVessel, AisVessels, Label, Odometry
from paani_services.navigator.mapping.dynamic_obstacles import DynamicObstacle
from paani_services.navigator.mapping.stamped_pose import StampedPose
from paani_services.navigator.mapping.velocity_fit import Velocity

UNDER_WAY_MPS = 0.25  # half a knot; what lies is the camera's to see, as the position is not good enough to pass it
# Of a vessel that does not tell its size: the smallest that is no small craft on inland waters (CEVNI 1.01) has 20 m.
UNKNOWN_LENGTH_M, UNKNOWN_BEAM_M = 20.0, 5.0
POSITION_STD_M = 2.0  # of both receivers, without correction signals
VELOCITY_STD_MPS = 0.1  # a speed is told in tenths of a knot, and a bend of the channel turns a vessel between reports
ALIKE_M = 6.0  # three standard deviations of the position: a vessel seen that near to a told one is that one
REACH_S = 30.0  # what cannot be at the boat within this time is none of the plan's (`clearance.APPROACH_S`)
MAX_TARGETS = 8  # nearest first; each costs the plan time
MAX_POINTS = 24  # of a hull


class AisTarget(msgspec.Struct, frozen=True, array_like=True):
    """A vessel under way: its middle now, by dead reckoning, course and speed over ground, size, age of its report."""

    mmsi: int
    east_m: float
    north_m: float
    course_rad: float
    speed_mps: float
    length_m: float
    beam_m: float
    age_s: float


def locate_targets(
    ais: AisVessels | None, odometry: Odometry, here: StampedPose, now_us: int, config: PlannerConfig
) -> tuple[AisTarget, ...]:
    """The nearest vessels under way, not older than `ais_max_age_s`, that may be at the boat within `REACH_S`."""
    found = []
    for vessel in ais.vessels if ais is not None else ():
        age_s = (now_us - vessel.fixed_us) * 1e-6
        if not 0.0 <= age_s <= config.ais_max_age_s or vessel.sog_mps < UNDER_WAY_MPS:
            continue
        target = _locate(vessel, odometry, here, age_s)
        away_m = math.hypot(target.east_m - here.x_m, target.north_m - here.y_m)
        if away_m - target.length_m <= REACH_S * (target.speed_mps + config.speed_mps):
            found.append((away_m, target))
    return tuple(target for _, target in sorted(found, key=lambda each: (each[0], each[1].mmsi))[:MAX_TARGETS])


def _locate(vessel: AisVessel, odometry: Odometry, here: StampedPose, age_s: float) -> AisTarget:
    """Where it is by now, if it kept its velocity; its hull lies along its course."""
    east_m, north_m = enu_from_geodetic(
        vessel.latitude_deg, vessel.longitude_deg, odometry.latitude_deg, odometry.longitude_deg
    )
    length_m, beam_m = vessel.to_bow_m + vessel.to_stern_m, vessel.to_port_m + vessel.to_starboard_m
    ahead_m = 0.5 * (vessel.to_bow_m - vessel.to_stern_m) + age_s * vessel.sog_mps
    aside_m = 0.5 * (vessel.to_port_m - vessel.to_starboard_m)
    cos, sin = portable.cos(vessel.cog_rad), portable.sin(vessel.cog_rad)
    return AisTarget(
        vessel.mmsi,
        here.x_m + east_m + ahead_m * cos - aside_m * sin,
        here.y_m + north_m + ahead_m * sin + aside_m * cos,
        wrap_rad(vessel.cog_rad),
        vessel.sog_mps,
        length_m if length_m > 0.0 else UNKNOWN_LENGTH_M,
        beam_m if beam_m > 0.0 else UNKNOWN_BEAM_M,
        age_s,
    )


def predict_unseen_targets(
    targets: Sequence[AisTarget],
    seen: Sequence[DynamicObstacle],
    boat: tuple[float, float, float],
    calibration: CalibrationConfig,
) -> list[DynamicObstacle]:
    """The targets that the camera does not look at and that are none of the obstacles which it saw.

    boat: position and yaw. What is told to be in the camera's field of view, the camera sees or refutes.
    """
    half_view_rad = math.radians(0.5 * calibration.hfov_deg)
    vessels = [each for each in seen if each.label is Label.VESSEL and each.is_moving]
    unseen = []
    for target in targets:
        bearing_rad = portable.atan2(target.north_m - boat[1], target.east_m - boat[0])
        if abs(wrap_rad(bearing_rad - boat[2])) > half_view_rad and not any(
            _hull_distance_m(target, each) <= ALIKE_M for each in vessels
        ):
            unseen.append(_predict(target))
    return unseen


def _predict(target: AisTarget) -> DynamicObstacle:
    """Points along the middle of its hull, no further apart than it is wide, with half of its beam around each."""
    count = min(math.ceil(target.length_m / target.beam_m) + 1, MAX_POINTS)
    along_m = np.linspace(-0.5, 0.5, count) * target.length_m
    cos, sin = portable.cos(target.course_rad), portable.sin(target.course_rad)
    return DynamicObstacle(
        target.east_m + along_m * cos,
        target.north_m + along_m * sin,
        0.5 * target.beam_m,
        Velocity(target.speed_mps * cos, target.speed_mps * sin, VELOCITY_STD_MPS),
        target.age_s,
        frozenset(),
        mmsi=target.mmsi,
        position_std_m=POSITION_STD_M,
    )


def _hull_distance_m(target: AisTarget, seen: DynamicObstacle) -> float:
    """From the nearest point of what was seen to the hull; 0 within it."""
    cos, sin = portable.cos(target.course_rad), portable.sin(target.course_rad)
    off_east_m, off_north_m = seen.east_m - target.east_m, seen.north_m - target.north_m
    ahead_m = np.abs(off_east_m * cos + off_north_m * sin) - 0.5 * target.length_m
    aside_m = np.abs(off_north_m * cos - off_east_m * sin) - 0.5 * target.beam_m
    return float(np.hypot(np.maximum(ahead_m, 0.0), np.maximum(aside_m, 0.0)).min())
