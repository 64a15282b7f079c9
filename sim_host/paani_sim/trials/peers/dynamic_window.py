"""The dynamic window approach as published. Pure.

Fox, Burgard, Thrun: "The dynamic window approach to collision avoidance", IEEE Robotics & Automation Magazine 4 (1997):
pairs of surge and turn rate that can be reached within one cycle, of which those count from which the boat can stop
before the next obstacle on its circle; of these the best by heading, clearance and speed. What moves counts where it
is now.
"""

from __future__ import annotations

import math

import numpy as np

from paani.arrays import F64
from paani.geometry import wrap_rad
from paani.motion_planning import HeadingSpeed, PlanningInputs
from paani_sim.trials.peers.obstacle_points import HULL_RADIUS_M, present_points_m

HEADING_WEIGHT, CLEARANCE_WEIGHT, SPEED_WEIGHT = 2.0, 0.2, 0.2  # alpha, beta and gamma of the paper
REACH_M = HULL_RADIUS_M + 0.25  # hull, and the least margin that the navigator's own planner keeps
CLEARANCE_CAP_M = 4.0  # larger clearances count as this
CYCLE_S = 0.25  # in which a pair is reached: between two plans
ACCEL_MPS2, YAW_ACCEL_RADPS2 = 0.4, 0.35  # as the navigator's own planner has them
MAX_YAW_RATE_RADPS = 0.35
SPEED_COUNT, RATE_COUNT = 7, 15
STEP_S, HORIZON_S = 0.25, 7.0  # along a circle
STEERING_SATURATION_RAD = 0.5  # heading error at which the controller turns as hard as it can


def plan_dynamic_window(inputs: PlanningInputs) -> HeadingSpeed:
    """Heading and speed that make the controller follow the best pair; a stop where none is admissible."""
    speeds_mps, rates_radps = _dynamic_window(inputs)
    clearance_m, end_yaw_rad = _follow_circles(present_points_m(inputs), inputs.yaw_rad, speeds_mps, rates_radps)
    admissible = speeds_mps <= np.sqrt(2.0 * ACCEL_MPS2 * clearance_m)
    if not admissible.any():
        return HeadingSpeed(inputs.yaw_rad, 0.0)
    off_rad = np.abs(np.array([wrap_rad(inputs.course_rad - yaw_rad) for yaw_rad in end_yaw_rad.tolist()]))
    score = (
        HEADING_WEIGHT * (1.0 - off_rad / math.pi)
        + CLEARANCE_WEIGHT * np.minimum(clearance_m, CLEARANCE_CAP_M) / CLEARANCE_CAP_M
        + SPEED_WEIGHT * speeds_mps / max(inputs.speed_mps, 1e-6)
    )
    best = int(np.where(admissible, score, -np.inf).argmax())
    steer_rad = STEERING_SATURATION_RAD * float(rates_radps[best]) / MAX_YAW_RATE_RADPS
    return HeadingSpeed(wrap_rad(inputs.yaw_rad + steer_rad), float(speeds_mps[best]))


def _dynamic_window(inputs: PlanningInputs) -> tuple[F64, F64]:
    surge_mps = min(max(inputs.surge_mps, 0.0), inputs.speed_mps)
    slowest_mps, fastest_mps = (surge_mps + sign * ACCEL_MPS2 * CYCLE_S for sign in (-1.0, 1.0))
    left, right = (inputs.yaw_rate_radps + sign * YAW_ACCEL_RADPS2 * CYCLE_S for sign in (1.0, -1.0))
    speeds = np.linspace(max(slowest_mps, 0.0), min(fastest_mps, inputs.speed_mps), SPEED_COUNT)
    rates = np.linspace(max(right, -MAX_YAW_RATE_RADPS), min(left, MAX_YAW_RATE_RADPS), RATE_COUNT)
    pairs = np.meshgrid(speeds, rates, indexing="ij")
    return pairs[0].ravel(), pairs[1].ravel()


def _follow_circles(points_m: F64, yaw_rad: float, speeds_mps: F64, rates_radps: F64) -> tuple[F64, F64]:
    """Distance sailed on each circle until a point is within `REACH_M`, at most `CLEARANCE_CAP_M`; and the heading.

    The heading is the one after the cycle and after braking to no turn.
    """
    times_s = np.arange(0.0, HORIZON_S + 1e-9, STEP_S)[:, None]
    yaws = yaw_rad + rates_radps * times_s
    x_m = np.cumsum(STEP_S * speeds_mps * np.cos(yaws), axis=0)
    y_m = np.cumsum(STEP_S * speeds_mps * np.sin(yaws), axis=0)
    end_yaw_rad = yaw_rad + rates_radps * (CYCLE_S + np.abs(rates_radps) / (2.0 * YAW_ACCEL_RADPS2))
    if not len(points_m):
        return np.full(speeds_mps.shape, CLEARANCE_CAP_M), end_yaw_rad
    near = points_m[np.hypot(points_m[:, 0], points_m[:, 1]) < CLEARANCE_CAP_M + 2.0 * REACH_M]
    hit = np.zeros(x_m.shape, np.bool_)
    for east_m, north_m in near.tolist():
        hit |= (x_m - east_m) ** 2 + (y_m - north_m) ** 2 < REACH_M**2
    sailed_m = np.where(hit, speeds_mps * times_s, np.inf).min(axis=0)
    return np.minimum(sailed_m, CLEARANCE_CAP_M), end_yaw_rad
