"""A boat that lies still keeps off what will strike it, where it knows water beside it and nothing else is there."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from paani.arrays import Bools
from paani.messages import Constraint, Label
from paani_services.navigator.avoidance.clearance import predict_clearances, struck_probability
from paani_services.navigator.avoidance.constraints import (
    STRUCK_GAIN,
    Refusals,
    any_refusal,
    hard_constraints,
    unless_struck_less,
)
from paani_services.navigator.avoidance.evaluation import CandidateEvaluation, evaluate_candidates
from paani_services.navigator.avoidance.rollout import (
    BoatState,
    GuidanceSetpoint,
    Plan,
    roll_out,
    with_coasting_and_resting,
)
from paani_services.navigator.mapping.dynamic_obstacles import DynamicObstacle
from paani_services.navigator.mapping.occupancy_grid import GRID_CELLS, OccupancyGrid
from paani_services.navigator.mapping.velocity_fit import Velocity
from tests.synthetic_water import PLANNER, plan_on, request_on

RESTING, AHEAD = BoatState(0.0, 0.0, 0.0), GuidanceSetpoint(0.0, 0.6)
NONE = np.zeros((GRID_CELLS, GRID_CELLS), np.bool_)
MIDDLES_M = (np.arange(GRID_CELLS) + 0.5) * 0.2 - 10.0


def water(*, free: Bools = ~NONE, occupied: Bools = NONE) -> OccupancyGrid:
    return OccupancyGrid(-10.0, -10.0, NONE | occupied, NONE, free & ~occupied, NONE, NONE, NONE)


def coming(distance_m: float, bearing_deg: float, speed_mps: float, *, std_mps: float = 0.1) -> DynamicObstacle:
    """A rowing boat, seen from its bow, on a course through the boat's middle. The bearing is to port."""
    cos, sin = math.cos(math.radians(bearing_deg)), math.sin(math.radians(bearing_deg))
    across_m = np.linspace(0.5, -0.5, 5)
    outline = distance_m * cos - across_m * sin, distance_m * sin + across_m * cos
    velocity = Velocity(-speed_mps * cos, -speed_mps * sin, std_mps)
    return DynamicObstacle(*outline, 0.2, velocity, 0.2, frozenset(), 3, Label.VESSEL)


def judged(grid: OccupancyGrid, *obstacles: DynamicObstacle) -> tuple[CandidateEvaluation, Refusals]:
    """The candidates of a boat at rest, and what stepping aside refuses."""
    evaluation = evaluate_candidates(request_on(grid, RESTING, AHEAD, None, PLANNER, obstacles))
    return evaluation, unless_struck_less(evaluation, hard_constraints(evaluation))


def gap_m(found: Plan, obstacle: DynamicObstacle) -> float:
    """Least distance from the boat's middle to the outline until it is past, of a boat that follows its plan."""
    trajectories = roll_out(RESTING, np.array([found.heading_rad]), np.array([found.speed_mps]), PLANNER)
    paths = with_coasting_and_resting(trajectories, RESTING, PLANNER)
    time_s = np.arange(0.0, 8.0, 0.05)
    at = 0 if found.speed_mps > 0.0 else -1
    x_m, y_m = (np.interp(time_s, paths.time_s, each[:, at]) for each in paths[:2])
    east_m = obstacle.east_m[:, None] + obstacle.velocity.east_mps * time_s - x_m
    north_m = obstacle.north_m[:, None] + obstacle.velocity.north_mps * time_s - y_m
    return float(np.hypot(east_m, north_m).min())


STANDING = Plan(0.0, 0.0)


@settings(deadline=None)
@example(side=1.0, bearing_deg=40.0, distance_m=10.0, speed_mps=3.0, std_mps=0.2)
@example(side=-1.0, bearing_deg=40.0, distance_m=10.0, speed_mps=3.0, std_mps=0.02)
@example(side=1.0, bearing_deg=140.0, distance_m=10.0, speed_mps=3.0, std_mps=0.2)
@example(side=-1.0, bearing_deg=140.0, distance_m=13.0, speed_mps=2.0, std_mps=0.2)
@example(side=1.0, bearing_deg=90.0, distance_m=13.0, speed_mps=2.0, std_mps=0.02)
@given(
    st.sampled_from([1.0, -1.0]),
    st.floats(40.0, 140.0),
    st.floats(10.0, 13.0),
    st.floats(2.0, 3.0),
    st.floats(0.02, 0.2),
)
def test_a_boat_at_rest_steps_aside_for_what_will_strike_it(
    side: float, bearing_deg: float, distance_m: float, speed_mps: float, std_mps: float
) -> None:
    """A rowing eight is there in three to six seconds: the boat leaves its track while there is time."""
    eight = coming(distance_m, side * bearing_deg, speed_mps, std_mps=std_mps)
    found = plan_on(water(), RESTING, AHEAD, None, PLANNER, (eight,))
    assert found.speed_mps > 0.0
    assert gap_m(found, eight) > gap_m(STANDING, eight) + 0.3


def test_it_takes_the_way_on_which_it_is_struck_least() -> None:
    evaluation, refusals = judged(water(), coming(10.0, 60.0, 3.0))
    taken = evaluation.struck[~any_refusal(refusals)]
    assert taken.max() <= evaluation.struck.min() + 0.25 * STRUCK_GAIN
    assert taken.max() <= evaluation.struck_when_coasting - STRUCK_GAIN


@pytest.mark.parametrize("aside_m", [-1.3, -1.4])
def test_what_will_rather_pass_moves_it_nowhere(aside_m: float) -> None:
    """It passes that far off, astern of the boat; whether to move on is a matter of margins and costs, as ever."""
    eight = coming(13.0, 60.0, 2.5)
    passing = eight._replace(east_m=eight.east_m + 0.87 * aside_m, north_m=eight.north_m - 0.5 * aside_m)
    evaluation, refusals = judged(water(), passing)
    assert evaluation.struck.min() + STRUCK_GAIN < evaluation.struck_when_coasting < 0.5
    assert any_refusal(refusals).all()


def test_it_goes_where_water_is_seen_and_nothing_stands() -> None:
    """Where the way out is a wall, or was never seen, the boat does not go there; where one is left, it takes that."""
    eight, beside = coming(10.0, 90.0, 3.0), np.abs(MIDDLES_M)[:, None] < 1.2
    unseen = plan_on(water(free=beside & (MIDDLES_M < 0.6)), RESTING, AHEAD, None, PLANNER, (eight,))
    assert unseen == STANDING
    near, further = (NONE | ((wall_m < MIDDLES_M) & (wall_m + 1.0 > MIDDLES_M)) for wall_m in (1.0, 1.5))
    assert any_refusal(judged(water(occupied=near), eight)[1]).all()
    evaluation, refusals = judged(water(occupied=further), coming(10.0, 60.0, 3.0))
    is_free = ~any_refusal(refusals)
    assert is_free.any()
    assert not is_free[evaluation.struck.argmin()]


def test_people_who_may_swim_are_kept_off_on_the_way() -> None:
    """They strike nothing, as they do not move for certain, but the boat does not step on to them."""
    eight, swimmer = coming(10.0, 90.0, 3.0), coming(2.5, 0.0, 0.0, std_mps=0.4)._replace(label=Label.PERSON)
    evaluation, refusals = judged(water(), eight, swimmer)
    ahead = (np.abs(evaluation.offsets_rad) < 0.2) & evaluation.is_full_speed
    assert refusals[Constraint.DYNAMIC_OBSTACLE][ahead].all()
    assert not judged(water(), eight)[1][Constraint.DYNAMIC_OBSTACLE].any()


def test_beside_a_person_it_does_not_go_at_full_speed() -> None:
    eight, people = coming(10.0, 90.0, 3.0), NONE.copy()
    people[54:57, 55:58] = True
    grid = water()._replace(people=people, occupied=people, free=~people)
    evaluation, refusals = judged(grid, eight)
    near_m = np.where(evaluation.is_in_horizon, evaluation.person_distance_m, np.inf).min(axis=0)
    beside = evaluation.is_full_speed & (near_m < evaluation.tight_clearance_m)
    assert beside.any()
    assert refusals[Constraint.TOO_FAST][beside].all()
    assert not refusals[Constraint.TOO_FAST][near_m > 2.0].any()


def test_where_what_comes_may_be_anywhere_no_way_out_is_better_than_another() -> None:
    vague, headings_rad = coming(10.0, 60.0, 1.5, std_mps=1.5), np.radians([-120.0, -60.0, 0.0, 60.0, 120.0])
    paths = with_coasting_and_resting(roll_out(RESTING, headings_rad, np.full(5, 0.6), PLANNER), RESTING, PLANNER)
    found = predict_clearances((vague,), paths, PLANNER)
    clearance_m = np.concatenate([found.candidates_m, found.coasting_m[:, :, None]], axis=2)
    struck = struck_probability((vague,), clearance_m, paths.time_s, PLANNER.hull_radius_m)
    assert struck[:-1].min() > struck[-1] - STRUCK_GAIN


def test_what_does_not_move_for_certain_strikes_nothing() -> None:
    swimmer = coming(3.0, 0.0, 0.0, std_mps=0.4)
    assert struck_probability((swimmer,), np.full((1, 2, 1), -1.0), np.arange(2.0), 0.55)[0] == 0.0


@pytest.mark.parametrize("clearance_m", [-2.0, 0.0, 2.0])
def test_the_probability_is_a_half_where_the_hull_is_just_reached(clearance_m: float) -> None:
    """And the worst moment counts."""
    eight = coming(10.0, 0.0, 3.0, std_mps=0.1)
    deviation_m = 0.1 * 0.2 + 0.1 * 0.2
    clearances = np.array([[[0.55 - deviation_m + clearance_m], [9.0]]])
    found = struck_probability((eight,), clearances, np.array([0.0, 1.0]), 0.55)[0]
    assert found == pytest.approx(0.5 - 0.5 * np.sign(clearance_m), abs=0.01)
