"""BendyRuler, as ArduPilot's rovers avoid obstacles. Pure.

After the description of object avoidance with BendyRuler in ArduPilot's documentation: bearings are probed a lookahead
away, first that of the destination, then ever farther to either side; the first whose whole line keeps the margin, and
from whose end a second line does so towards the destination, is taken. A large change of bearing needs a margin that is
better by a ratio. Where no bearing keeps the margin, the one that keeps most is taken. It knows nothing of velocities.
"""

from __future__ import annotations

import math

import numpy as np

from paani.arrays import F64
from paani.geometry import wrap_rad
from paani.motion_planning import HeadingSpeed, PlanningInputs
from paani_sim.trials.peers.obstacle_points import HULL_RADIUS_M, present_points_m

LOOKAHEAD_M = 5.0  # OA_BR_LOOKAHEAD: a third of its default, as the map reaches 8 m
MARGIN_M = HULL_RADIUS_M + 0.7  # OA_MARGIN_MAX: hull and margin of the navigator's own planner
BEARING_STEP_RAD, LAST_BEARING_RAD = math.radians(5.0), math.radians(170.0)
SECOND_LINE_RAD = (0.0, math.radians(45.0), math.radians(-45.0))
CHANGE_RATIO, CHANGE_ANGLE_RAD = 1.5, math.radians(75.0)  # OA_BR_CONT_RATIO, OA_BR_CONT_ANGLE


def plan_bendy_ruler(inputs: PlanningInputs) -> HeadingSpeed:
    """The bearing to sail on, at the speed asked for."""
    points_m = present_points_m(inputs)
    origin = np.zeros(2)
    best_rad, best_m = inputs.course_rad, -math.inf
    for off_rad in probed_bearings_rad():
        bearing_rad = wrap_rad(inputs.course_rad + off_rad)
        margin_m, end = probe_margin_m(points_m, origin, bearing_rad)
        if margin_m > best_m:
            best_rad, best_m = bearing_rad, margin_m
        if margin_m > MARGIN_M and any(
            probe_margin_m(points_m, end, inputs.course_rad + second_rad)[0] > MARGIN_M
            for second_rad in SECOND_LINE_RAD
        ):
            best_rad, best_m = bearing_rad, margin_m
            break
    return HeadingSpeed(_resist_change(inputs, points_m, best_rad, best_m), inputs.speed_mps)


def probed_bearings_rad() -> list[float]:
    """Off the destination's bearing: 0, then alternately to either side."""
    count = round(LAST_BEARING_RAD / BEARING_STEP_RAD)
    return [0.0, *(side * k * BEARING_STEP_RAD for k in range(1, count + 1) for side in (1.0, -1.0))]


def probe_margin_m(points_m: F64, start_m: F64, bearing_rad: float) -> tuple[float, F64]:
    """Distance of the nearest point to a line of `LOOKAHEAD_M`, and the line's end."""
    way = np.array([math.cos(bearing_rad), math.sin(bearing_rad)])
    end: F64 = start_m + LOOKAHEAD_M * way
    if not len(points_m):
        return math.inf, end
    rel = points_m - start_m
    along_m = np.clip(rel @ way, 0.0, LOOKAHEAD_M)
    return float(np.hypot(*(rel - along_m[:, None] * way).T).min()), end


def _resist_change(inputs: PlanningInputs, points_m: F64, bearing_rad: float, margin_m: float) -> float:
    previous_rad = inputs.previous_heading_rad
    if previous_rad is None or abs(wrap_rad(bearing_rad - previous_rad)) <= CHANGE_ANGLE_RAD:
        return bearing_rad
    previous_m = probe_margin_m(points_m, np.zeros(2), previous_rad)[0]
    return bearing_rad if margin_m >= CHANGE_RATIO * previous_m else previous_rad
