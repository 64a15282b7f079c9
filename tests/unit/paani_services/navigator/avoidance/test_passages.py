"""Courtesy towards vessels under way: what it asks for, what it does not, and that it never costs clearance."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from paani.messages import Label
from paani_services.navigator.avoidance.constraints import any_refusal, check_margins, hard_constraints
from paani_services.navigator.avoidance.costs import (
    GIVE_WAY_WEIGHT,
    PASSING_SIDE_WEIGHT,
    CandidateCosts,
    add_courtesy,
    weigh_candidates,
)
from paani_services.navigator.avoidance.evaluation import CandidateEvaluation, evaluate_candidates
from paani_services.navigator.avoidance.passages import find_passages
from paani_services.navigator.avoidance.planner import judge_candidates
from paani_services.navigator.avoidance.rollout import BoatState, GuidanceSetpoint
from paani_services.navigator.mapping.dynamic_obstacles import DynamicObstacle
from paani_services.navigator.mapping.observed_cells import CELL_M
from paani_services.navigator.mapping.occupancy_grid import OccupancyGrid
from paani_services.navigator.mapping.velocity_fit import Velocity
from tests.kinematic_imazu import open_water
from tests.synthetic_water import plan_on, request_on

EASTWARD, AHEAD = BoatState(0.0, 0.0, 0.0, 0.6), GuidanceSetpoint(0.0, 0.6)
WATER = open_water(EASTWARD)
SURE_MPS = 0.03  # standard deviation of a velocity that is well known


def vessel(
    x_m: float,
    y_m: float,
    east_mps: float,
    north_mps: float,
    std_mps: float = SURE_MPS,
    age_s: float = 0.1,
    label: Label = Label.VESSEL,
) -> DynamicObstacle:
    outline = (np.full(9, x_m), y_m + np.linspace(-0.5, 0.5, 9))
    return DynamicObstacle(*outline, 0.2, Velocity(east_mps, north_mps, std_mps), age_s, frozenset(), 1, label)


def evaluate(*obstacles: DynamicObstacle, grid: OccupancyGrid = WATER) -> CandidateEvaluation:
    return evaluate_candidates(request_on(grid, EASTWARD, AHEAD, obstacles=obstacles))


def costs_of(*obstacles: DynamicObstacle) -> CandidateCosts:
    """The costs of the full-speed candidates alone, the desired course first, then its neighbours, port first."""
    judged = judge_candidates(request_on(WATER, EASTWARD, AHEAD, obstacles=obstacles))
    assert judged is not None
    return CandidateCosts(*(each[judged.evaluation.is_full_speed] for each in judged.costs))


def largest_courtesy(*obstacles: DynamicObstacle) -> float:
    costs = costs_of(*obstacles)
    return float((costs.give_way + costs.passing_side).max())


ONCOMING = vessel(12.0, 0.0, -0.6, 0.0)


@settings(max_examples=25, deadline=None)
@given(range_m=st.floats(10.0, 14.0), off_m=st.floats(-0.3, 0.3), course_deg=st.floats(-5.0, 5.0))
@pytest.mark.slow
def test_head_on_the_boat_turns_to_starboard(range_m: float, off_m: float, course_deg: float) -> None:
    """So that both pass port to port: early, by a turn that is seen, and without slowing down."""
    course_rad = math.radians(180.0 + course_deg)
    met = vessel(range_m, off_m, 0.6 * math.cos(course_rad), 0.6 * math.sin(course_rad))
    plan = plan_on(WATER, EASTWARD, AHEAD, obstacles=(met,))
    assert plan.heading_rad < -math.radians(19.0)
    assert plan.speed_mps == 0.6


@settings(max_examples=25, deadline=None)
@given(time_s=st.floats(9.0, 14.0), speed_mps=st.floats(0.4, 0.9), side=st.sampled_from([-1.0, 1.0]))
@pytest.mark.slow
def test_a_crossing_vessel_is_passed_astern(time_s: float, speed_mps: float, side: float) -> None:
    """It would be met in so many seconds; the boat turns to the side that it comes from, or slows down."""
    met = vessel(0.6 * time_s, side * speed_mps * time_s, 0.0, -side * speed_mps)
    plan = plan_on(WATER, EASTWARD, AHEAD, obstacles=(met,))
    passages = find_passages(evaluate_candidates(request_on(WATER, EASTWARD, AHEAD, obstacles=(met,))))
    assert side * plan.heading_rad > math.radians(9.0) or plan.speed_mps < 0.6
    wanted = passages.wanted_side[0, 0]
    assert wanted == pytest.approx(-side)  # one from starboard is left to port


def test_give_way_costs_what_leads_near_and_nothing_beyond_what_is_wanted() -> None:
    """It falls with the distance of the outline at the closest point, the same to either side."""
    costs = costs_of(ONCOMING)
    assert costs.give_way[0] == costs.give_way.max() > 0.8 * GIVE_WAY_WEIGHT
    steps = [costs.give_way[1::2], costs.give_way[2::2]]  # further and further to port, to starboard
    for side in steps:
        assert (np.diff(side[:6]) <= 0.0).all()
        assert side[5] == 0.0
    assert steps[0][:5] == pytest.approx(steps[1][:5], abs=1e-6)


def test_passing_side_costs_the_wrong_side_alone() -> None:
    costs = costs_of(ONCOMING)
    port, starboard = costs.passing_side[1::2], costs.passing_side[2::2]
    assert port[2] > 0.9 * PASSING_SIDE_WEIGHT * find_passages(evaluate(ONCOMING)).weight.max()
    assert starboard[2] < 0.1 * PASSING_SIDE_WEIGHT
    assert (port[:4] > starboard[:4] + 0.3).all()


def test_the_less_sure_the_side_the_less_it_tells_the_sides_apart() -> None:
    gaps = []
    for std_mps in (0.03, 0.15):
        met = ONCOMING._replace(velocity=Velocity(-0.6, 0.0, std_mps))
        costs, weight = costs_of(met), find_passages(evaluate(met)).weight.max()
        gaps.append((costs.passing_side[5] - costs.passing_side[6]) / weight)  # 30 degrees to port, to starboard
    assert gaps[0] > 0.9 * PASSING_SIDE_WEIGHT > gaps[1] + 0.1


@pytest.mark.parametrize(
    ("course_deg", "wanted"),
    [(0.0, 0.0), (15.0, 0.12), (-15.0, -0.12), (60.0, 1.0), (-60.0, -1.0), (-160.0, 0.0), (-140.0, -1.0), (170.0, 1.0)],
)
def test_the_side_is_that_of_the_courses_and_either_where_they_are_nearly_the_same(
    course_deg: float, wanted: float
) -> None:
    course_rad = math.radians(course_deg)
    met = vessel(6.0, 0.0, 0.4 * math.cos(course_rad), 0.4 * math.sin(course_rad))
    assert find_passages(evaluate(met)).wanted_side[0, 0] == pytest.approx(wanted, abs=0.02)


@pytest.mark.parametrize(
    "other",
    [
        vessel(12.0, 0.0, 0.0, 0.0),  # it stands still
        vessel(12.0, 0.0, -0.1, 0.0),  # it may be adrift
        vessel(12.0, 0.0, -0.25, 0.0, std_mps=0.1),  # so may this one, for all that is known
        vessel(-3.0, 0.0, -0.6, 0.0),  # it is past
        vessel(60.0, 0.0, -0.6, 0.0),  # it is far off
        vessel(12.0, 0.0, -0.6, 0.0, std_mps=0.4),  # it may pass anywhere
        vessel(12.0, 0.0, -0.6, 0.0, age_s=29.0),  # and so may one out of sight for long
        vessel(12.0, 0.0, -0.6, 0.0, label=Label.PERSON),  # a swimmer knows no rules
        vessel(12.0, 14.0, -0.6, 0.0),  # it passes far off
    ],
)
def test_there_is_no_courtesy_towards(other: DynamicObstacle) -> None:
    assert np.asarray(costs_of(other).give_way)[0] == 0.0
    assert costs_of(other).passing_side[0] == 0.0


@settings(max_examples=25, deadline=None)
@given(std_mps=st.tuples(st.floats(0.0, 0.3), st.floats(0.0, 0.3)), age_s=st.floats(0.0, 10.0))
@pytest.mark.slow
def test_the_surer_the_velocity_the_more_it_counts(std_mps: tuple[float, float], age_s: float) -> None:
    low, high = sorted(std_mps)
    sure, unsure = (find_passages(evaluate(vessel(12.0, 0.0, -0.6, 0.0, std, age_s))).weight for std in (low, high))
    assert (sure >= unsure - 1e-12).all()
    assert (sure <= 1.0).all()
    assert (unsure >= 0.0).all()


@settings(max_examples=25, deadline=None)
@given(range_m=st.floats(4.0, 12.0), north_m=st.floats(-1.0, 1.0), speed_mps=st.floats(0.25, 0.4))
@example(range_m=4.0, north_m=0.0, speed_mps=0.3)  # as fast as a candidate, so that the two stand still to each other
@pytest.mark.slow
def test_slowing_down_behind_a_vessel_does_not_end_the_encounter(
    range_m: float, north_m: float, speed_mps: float
) -> None:
    """It would be met later, or never; but the boat that follows it is no less on its course."""
    evaluation = evaluate(vessel(range_m, north_m, speed_mps, 0.0))
    weight = find_passages(evaluation).weight.reshape(-1, 3)  # headings, speeds
    assert weight == pytest.approx(np.repeat(weight[:, :1], 3, axis=1))
    assert weight[0, 0] > 0.0 or range_m / (0.6 - speed_mps) > 25.0


def test_what_counts_is_how_sure_the_velocity_is_across_the_line_of_sight() -> None:
    """A range that is known badly says little of when they meet, and nothing of the side."""
    along, across = (0.09, 0.0, 0.0001), (0.0001, 0.0, 0.09)
    far = [
        find_passages(evaluate(ONCOMING._replace(velocity=Velocity(-0.9, 0.0, 0.3, covariance))))
        for covariance in (along, across)
    ]
    assert far[0].deviation_m[0, 0] < 0.2
    assert far[1].deviation_m[0, 0] > 2.0


@settings(max_examples=60, deadline=None)
@given(
    banks=st.tuples(st.floats(0.7, 1.9), st.floats(0.7, 1.9)),
    place=st.tuples(st.floats(4.0, 13.0), st.floats(-2.0, 2.0)),
    velocity=st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)),
)
@example(banks=(1.06, 1.57), place=(7.4, -0.19), velocity=(-0.73, -0.19))
@example(banks=(1.8, 0.97), place=(7.1, -1.71), velocity=(-0.48, 0.53))
@pytest.mark.slow
def test_courtesy_never_leads_further_into_the_margin(
    banks: tuple[float, float], place: tuple[float, float], velocity: tuple[float, float]
) -> None:
    """In a ditch with hardly a margin to either side, the boat intrudes no more than it would without courtesy."""
    occupied = np.zeros_like(WATER.occupied)
    north, south = (round((each_m - WATER.south_m) / CELL_M) for each_m in (banks[0], -banks[1]))
    occupied[north : north + 3] = occupied[south - 3 : south] = True
    evaluation = evaluate(vessel(*place, *velocity), grid=WATER._replace(occupied=occupied, free=~occupied))
    hard = hard_constraints(evaluation)
    check = check_margins(evaluation, hard)
    passages, is_refused = find_passages(evaluation), any_refusal(check.refusals)
    plain = weigh_candidates(evaluation, check.margin_m, passages)
    costs = add_courtesy(plain, passages, is_refused)
    assert (costs.give_way <= GIVE_WAY_WEIGHT).all()
    assert (costs.passing_side <= PASSING_SIDE_WEIGHT).all()
    if is_refused.all() or costs is plain:
        return
    without, chosen = (int(np.where(is_refused, np.inf, each.total).argmin()) for each in (plain, costs))
    assert costs.margin[chosen] <= plain.margin[without]
    intrudes_more = plain.margin > plain.margin[without]
    assert (costs.give_way[intrudes_more] == GIVE_WAY_WEIGHT).all()
    assert (costs.passing_side[intrudes_more] == PASSING_SIDE_WEIGHT).all()


@settings(max_examples=25, deadline=None)
@given(
    place=st.tuples(st.floats(3.0, 13.0), st.floats(-8.0, 8.0)),
    velocity=st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)),
)
@pytest.mark.slow
def test_giving_way_is_the_same_mirrored(place: tuple[float, float], velocity: tuple[float, float]) -> None:
    (x_m, y_m), (east_mps, north_mps) = place, velocity
    here, mirrored = (
        find_passages(evaluate(vessel(x_m, side * y_m, east_mps, side * north_mps))) for side in (1.0, -1.0)
    )
    full = evaluate(ONCOMING).is_full_speed
    order = [0, *(number + 1 if number % 2 else number - 1 for number in range(1, int(full.sum()) - 1))]
    for ours, theirs in ((here.port_m, mirrored.starboard_m), (here.weight, mirrored.weight)):
        if len(ours):
            assert ours[:, full][:, order] == pytest.approx(theirs[:, full][:, : len(order)], abs=1e-6)
