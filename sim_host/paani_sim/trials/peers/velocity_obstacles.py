"""Velocity obstacles with the navigator's own tracks. Pure.

Fiorini, Shiller: "Motion planning in dynamic environments using velocity obstacles", Int. J. of Robotics Research 17
(1998): velocities that lead into an obstacle, moving as it does now, within a time horizon are avoided; of the others
the nearest to the one asked for is taken. Where all are forbidden, the one that trades nearness to it for time, with
the penalty of van den Berg, Lin, Manocha: "Reciprocal velocity obstacles", ICRA 2008.
"""

from __future__ import annotations

import math

import numpy as np

from paani.arrays import F64
from paani.geometry import wrap_rad
from paani.motion_planning import HeadingSpeed, PlanningInputs
from paani_sim.trials.peers.obstacle_points import HULL_RADIUS_M, static_points_m

MARGIN_M = HULL_RADIUS_M + 0.7  # hull and margin of the navigator's own planner
HORIZON_S = 8.0  # in which the boat sails the 5 m to which its map is dense
HEADING_COUNT, SPEED_FRACTIONS = 72, (1.0, 0.75, 0.5, 0.25, 0.0)
COLLISION_WEIGHT_M = 1.0  # of the inverse time to collision
TOO_LATE_S = 1.5  # with less time to a collision the boat stops


def plan_velocity_obstacles(inputs: PlanningInputs) -> HeadingSpeed:
    """The heading and speed of the best velocity."""
    off_rad = np.repeat(2.0 * math.pi / HEADING_COUNT * np.arange(HEADING_COUNT), len(SPEED_FRACTIONS))
    speeds_mps = inputs.speed_mps * np.tile(SPEED_FRACTIONS, HEADING_COUNT)
    headings_rad = inputs.course_rad + off_rad
    velocities = np.column_stack([speeds_mps * np.cos(headings_rad), speeds_mps * np.sin(headings_rad)])
    wanted = inputs.speed_mps * np.array([math.cos(inputs.course_rad), math.sin(inputs.course_rad)])
    time_s = _times_to_collision_s(inputs, velocities)
    cost = np.hypot(*(velocities - wanted).T)
    is_free = time_s >= HORIZON_S
    if is_free.any():
        best = int(np.where(is_free, cost, np.inf).argmin())
    else:
        best = int((cost + COLLISION_WEIGHT_M / np.maximum(time_s, 1e-3)).argmin())
        if time_s[best] < TOO_LATE_S:
            return HeadingSpeed(inputs.yaw_rad, 0.0)
    if speeds_mps[best] == 0.0:
        return HeadingSpeed(inputs.yaw_rad, 0.0)
    return HeadingSpeed(wrap_rad(float(headings_rad[best])), float(speeds_mps[best]))


def _times_to_collision_s(inputs: PlanningInputs, velocities: F64) -> F64:
    """Of each velocity `(n, 2)`, the time until the first point is within the margin; infinite without any."""
    earliest_s = time_to_points_s(static_points_m(inputs), velocities)
    for each in inputs.moving:
        points_m = np.column_stack([each.east_m - inputs.x_m, each.north_m - inputs.y_m])
        relative = velocities - np.array([each.velocity_east_mps, each.velocity_north_mps])
        earliest_s = np.minimum(earliest_s, time_to_points_s(points_m, relative))
    return earliest_s


def time_to_points_s(points_m: F64, velocities: F64) -> F64:
    """Time until any of the points `(k, 2)`, at rest, is within the margin; a point that is within counts if neared."""
    reach_m = float(np.hypot(velocities[:, 0], velocities[:, 1]).max(initial=0.0)) * HORIZON_S + MARGIN_M
    near = points_m[np.hypot(points_m[:, 0], points_m[:, 1]) < reach_m]
    if not len(near):
        return np.full(len(velocities), np.inf)
    nearing = velocities @ near.T  # [n, k]: positive where the distance shrinks
    square = (velocities**2).sum(axis=1)[:, None]
    excess_m2 = (near**2).sum(axis=1)[None, :] - MARGIN_M**2
    discriminant = nearing**2 - square * excess_m2
    with np.errstate(divide="ignore", invalid="ignore"):
        entry_s = (nearing - np.sqrt(discriminant)) / square
    meets = (discriminant > 0.0) & (nearing > 0.0)
    return np.asarray(np.where(meets, np.maximum(entry_s, 0.0), np.inf).min(axis=1))
