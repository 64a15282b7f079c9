"""The clearance to a dynamic obstacle, predicted for all candidates, the coasting and the resting boat in one go."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paani.config import PlannerConfig, load_config
from paani.messages import Constraint
from paani_services.navigator.avoidance.clearance import (
    APPROACH_S,
    UNSEEN_GROWTH_MPS,
    DynamicClearance,
    closest_point_of_approach,
    predict_clearances,
    predicted_clearance_m,
    separation_margin_m,
)
from paani_services.navigator.avoidance.constraints import check_margins, hard_constraints
from paani_services.navigator.avoidance.evaluation import evaluate_candidates
from paani_services.navigator.avoidance.rollout import (
    BoatState,
    GuidanceSetpoint,
    roll_out,
    roll_out_coasting,
    sample_candidates,
    with_coasting_and_resting,
)
from paani_services.navigator.mapping.dynamic_obstacles import DynamicObstacle
from paani_services.navigator.mapping.observed_cells import CELL_M
from paani_services.navigator.mapping.occupancy_grid import GRID_CELLS, OccupancyGrid
from paani_services.navigator.mapping.velocity_fit import Velocity
from tests.synthetic_water import PLANNER, request_on

PAPER = load_config(profile="paper").navigator.planner


@settings(max_examples=20, deadline=None)
@given(
    place=st.tuples(st.floats(-6.0, 6.0), st.floats(-6.0, 6.0)),
    velocity=st.tuples(st.floats(-0.8, 0.8), st.floats(-0.8, 0.8), st.floats(0.0, 0.3)),
    age_s=st.floats(0.0, 20.0),
    boat=st.tuples(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), st.floats(-3.1, 3.1), st.floats(0.0, 0.6)),
)
@pytest.mark.slow
def test_one_prediction_holds_for_candidates_and_for_a_boat_that_coasts_or_rests(
    place: tuple[float, float],
    velocity: tuple[float, float, float],
    age_s: float,
    boat: tuple[float, float, float, float],
) -> None:
    """Each is the distance to the nearest outline point where it is then, less its room and its uncertainty."""
    outline = np.array([[0.0, 0.4, 0.8], [0.0, -0.3, 0.1]]) + np.array(place)[:, None]
    obstacle = DynamicObstacle(outline[0], outline[1], 0.2, Velocity(*velocity), age_s, frozenset())
    start = BoatState(*boat)
    candidates = roll_out(start, *sample_candidates(start, GuidanceSetpoint(0.3, 0.6), PLANNER), PLANNER)
    coasting = roll_out_coasting(start, candidates.time_s, PLANNER)
    elsewhere, time_s = obstacle._replace(east_m=outline[0] + 9.0), candidates.time_s[:, None]
    paths = with_coasting_and_resting(candidates, start, PLANNER)
    predicted = DynamicClearance(*(each[1] for each in predict_clearances([elsewhere, obstacle], paths, PLANNER)))
    there_m = outline[:, None, :] + np.array(velocity[:2])[:, None, None] * time_s
    unsure_m = velocity[2] * (time_s[:, 0] + age_s) + UNSEEN_GROWTH_MPS * age_s

    def clearance_m(x_m: np.ndarray, y_m: np.ndarray) -> np.ndarray:
        gaps_m = np.hypot(x_m[:, None] - there_m[0], y_m[:, None] - there_m[1])
        return np.asarray(gaps_m.min(axis=1) - 0.2 - unsure_m)

    for number in (0, 7, -1):
        x_m, y_m = candidates.x_m[:, number], candidates.y_m[:, number]
        np.testing.assert_allclose(predicted.candidates_m[:, number], clearance_m(x_m, y_m), atol=1e-9)
    np.testing.assert_allclose(predicted.coasting_m, clearance_m(coasting.x_m[:, 0], coasting.y_m[:, 0]), atol=1e-9)
    count = int((candidates.time_s <= PLANNER.horizon_s + 1e-9).sum())
    rests_m = clearance_m(np.full(time_s.size, boat[0]), np.full(time_s.size, boat[1]))[:count]
    np.testing.assert_allclose(predicted.resting_m[:count], np.minimum.accumulate(rests_m), atol=1e-9)
    assert (predicted.resting_m[count:] == predicted.resting_m[count - 1]).all()
    alone_m = predicted_clearance_m(obstacle, candidates.x_m, candidates.y_m, time_s)
    assert np.array_equal(predicted.candidates_m, alone_m)


@given(
    place=st.tuples(st.floats(-15.0, 15.0), st.floats(-15.0, 15.0)),
    velocity=st.tuples(st.floats(-1.5, 1.5), st.floats(-1.5, 1.5)),
    yaw_rad=st.floats(-3.1, 3.1),
    way=st.tuples(st.floats(0.0, 0.8), st.floats(-0.5, 0.5)),
)
def test_the_closest_point_is_that_of_two_that_sail_on(
    place: tuple[float, float], velocity: tuple[float, float], yaw_rad: float, way: tuple[float, float]
) -> None:
    """Surge along the heading and sway to port of it, against the distance at each of many times."""
    east_m, north_m = (np.array([each_m]) for each_m in place)
    point = DynamicObstacle(east_m, north_m, 0.2, Velocity(*velocity, 0.0), 0.0, frozenset())
    found = closest_point_of_approach(point, BoatState(1.0, -2.0, yaw_rad, way[0], 0.0, way[1]))
    time_s = np.linspace(0.0, APPROACH_S, 3001)
    over_ground = complex(*velocity) - complex(*way) * np.exp(1j * yaw_rad)
    gap_m = np.abs(complex(*place) - complex(1.0, -2.0) + over_ground * time_s)
    assert found.now_m == pytest.approx(gap_m[0])
    assert found.cpa_m == pytest.approx(gap_m.min(), abs=0.05)
    assert found.cpa_m <= gap_m.min() + 1e-6


@pytest.mark.parametrize("config", [PAPER, PLANNER], ids=["paper", "paani"])
@pytest.mark.parametrize("obstacle_m", [(0.6, 0.9), (0.6, -0.9), (2.1, 0.9), (2.1, -0.9)])
def test_q4_q6_a_candidate_is_refused_where_the_hull_comes_too_near_at_any_step_of_3_s(
    obstacle_m: tuple[float, float], config: PlannerConfig
) -> None:
    """On the way as at its end, with the drift of that time; a boat that is nearer already comes no nearer."""
    cells, none = np.zeros((GRID_CELLS, GRID_CELLS), np.bool_), np.zeros((GRID_CELLS, GRID_CELLS), np.bool_)
    column, row = (int((each_m + 10.0) / CELL_M) for each_m in obstacle_m)
    cells[row, column] = True
    grid = OccupancyGrid(-10.0, -10.0, cells, none, ~cells, none, none, none, none)
    within = msgspec.structs.replace(config, room_m=0.0)
    start, setpoint = BoatState(0.0, 0.0, 0.0, config.speed_mps), GuidanceSetpoint(0.0, config.speed_mps)
    evaluation = evaluate_candidates(request_on(grid, start, setpoint, None, within))
    refused = check_margins(evaluation, hard_constraints(evaluation)).refusals[Constraint.STATIC_OBSTACLE]
    time_s, clearance_m = 0.2 * np.arange(16)[:, None], evaluation.static_clearance_m[:16]
    needed_m = np.minimum(0.55 + config.margin_m + 0.15 * time_s, clearance_m[0, 0] - 0.5 * CELL_M)
    assert np.array_equal(refused, (clearance_m < needed_m).any(axis=0))
    assert 0 < refused.sum() < refused.size


@pytest.mark.parametrize(("config", "margin_m"), [(PAPER, 0.25), (PLANNER, 0.7)], ids=["paper", "paani"])
def test_q6_what_moves_is_kept_as_clear_of(config: PlannerConfig, margin_m: float) -> None:
    time_s = np.array([0.0, 1.0, 2.0, 3.0])
    for resting_m, required_m in ((9.0, 0.55 + margin_m + 0.15 * time_s), (0.6, np.full(4, 0.5))):
        clearance = DynamicClearance(np.full((1, 4, 2), 3.0), np.full((1, 4), 3.0), np.full((1, 4), resting_m))
        for kept_m in separation_margin_m(clearance, time_s, config)[0].T:
            assert kept_m == pytest.approx(3.0 - required_m)
