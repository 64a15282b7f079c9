"""Between what is there and what may be somewhere: no way out leads into what is there."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paani.messages import Constraint, Label
from paani_services.navigator.avoidance.clearance import margins
from paani_services.navigator.avoidance.constraints import (
    any_refusal,
    hard_constraints,
    unless_clearer_than_coasting,
)
from paani_services.navigator.avoidance.evaluation import evaluate_candidates
from paani_services.navigator.avoidance.rollout import BoatState, GuidanceSetpoint
from paani_services.navigator.mapping.dynamic_obstacles import DynamicObstacle
from paani_services.navigator.mapping.occupancy_grid import OccupancyGrid, build_occupancy_grid
from paani_services.navigator.mapping.velocity_fit import Velocity
from paani_sim.eye.camera import BoatPose
from tests.synthetic_water import CAMERA, EMPTY_MEMORY, PLANNER, START_US, observe_from, request_on, water_edge_of

LEAST = margins(PLANNER)[-1]
NEEDED_M = LEAST.hull_radius_m + LEAST.margin_m
HALF_CELL_M = 0.05
APPROACH_M = 4.0
LOOKS_RAD = (3.1, 2.2, 1.3, 0.5, -2.2, -1.3, -0.5, 0.0)


def water_with_a_bar(ahead_m: float, aside_m: float, wide_m: float) -> OccupancyGrid:
    """Of a boat that saw a bar from further off, lies before it now, and has looked round."""
    bar = (ahead_m, aside_m - 0.5 * wide_m, ahead_m + 0.6, aside_m + 0.5 * wide_m)
    poses = [BoatPose(-APPROACH_M, 0.0, 0.0), *(BoatPose(0.0, 0.0, yaw_rad) for yaw_rad in LOOKS_RAD)]
    memory, at_us = EMPTY_MEMORY, START_US
    for pose in poses:
        memory, at_us = observe_from(pose, water_edge_of(pose, (bar,)), at_us, memory), at_us + 100_000
    return build_occupancy_grid(memory.observations, (0.0, 0.0), at_us - 100_000, CAMERA, PLANNER)


def vessel_out_of_sight(away_m: float, bearing_rad: float, course_rad: float, age_s: float) -> DynamicObstacle:
    """It was under way when it was seen last, and may be anywhere around by now."""
    ahead, velocity = (
        np.array([math.cos(bearing_rad), math.sin(bearing_rad)]),
        0.5 * np.array([math.cos(course_rad), math.sin(course_rad)]),
    )
    side = np.linspace(-0.5, 0.5, 5)
    return DynamicObstacle(
        away_m * ahead[0] - side * ahead[1],
        away_m * ahead[1] + side * ahead[0],
        0.2,
        Velocity(float(velocity[0]), float(velocity[1]), 0.1),
        age_s,
        frozenset(),
        label=Label.VESSEL,
    )


@settings(max_examples=100, deadline=None)
@given(
    bar=st.tuples(st.floats(0.7, 2.0), st.floats(-0.8, 0.8), st.floats(0.5, 3.0)),
    vessel=st.tuples(st.floats(1.5, 4.0), st.floats(-3.1, 3.1), st.floats(-3.1, 3.1), st.floats(2.0, 12.0)),
    surge_mps=st.floats(0.0, 0.6),
)
@pytest.mark.slow
def test_no_last_way_out_leads_into_what_is_there(
    bar: tuple[float, float, float], vessel: tuple[float, float, float, float], surge_mps: float
) -> None:
    """Each keeps hull and least margin clear of static obstacles, or as much as the boat does now.

    A boat that is carried nearer whatever it does comes no nearer than it must.
    """
    request = request_on(
        water_with_a_bar(*bar),
        BoatState(0.0, 0.0, 0.0, surge_mps),
        GuidanceSetpoint(0.0, 0.6),
        obstacles=(vessel_out_of_sight(*vessel),),
    )
    evaluation = evaluate_candidates(request)
    static_m = np.where(evaluation.is_in_horizon, evaluation.static_clearance_m, np.inf).min(axis=0)
    hard = hard_constraints(evaluation)
    hard = {**hard, Constraint.TOO_FAST: hard[Constraint.TOO_FAST] | evaluation.is_full_speed}
    left = ~any_refusal(unless_clearer_than_coasting(evaluation, hard))
    best_m = max(static_m[~any_refusal(hard)].max(initial=-math.inf), evaluation.coasting_static_m)
    now_m = evaluation.static_clearance_m[0, 0]
    assert (static_m[left] >= min(NEEDED_M, min(now_m, best_m) - HALF_CELL_M) - 1e-9).all()
