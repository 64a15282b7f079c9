"""A vessel that would run the boat down is left while there is time, at the speed that the boat has."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from paani.geometry import wrap_rad
from paani.messages import Constraint, Label
from paani_services.navigator.avoidance.clearance import SWIMMING_MPS, UNDER_WAY_MPS, predicted_clearance_m
from paani_services.navigator.avoidance.constraints import any_refusal, hard_constraints
from paani_services.navigator.avoidance.evaluation import CandidateEvaluation, evaluate_candidates
from paani_services.navigator.avoidance.passages import find_passages
from paani_services.navigator.avoidance.planner import judge_candidates
from paani_services.navigator.avoidance.replanning import PlanBasis, PlannerState, replan
from paani_services.navigator.avoidance.rollout import BoatState, GuidanceSetpoint, Plan
from paani_services.navigator.mapping.dynamic_obstacles import DynamicObstacle
from paani_services.navigator.mapping.occupancy_grid import OccupancyGrid, build_occupancy_grid
from paani_services.navigator.mapping.velocity_fit import Velocity
from paani_sim.eye.camera import BoatPose
from tests.kinematic_imazu import STEP_S, moved
from tests.synthetic_water import (
    CAMERA,
    PLANNER,
    START_US,
    observe_from,
    odometry,
    open_water,
    plan_on,
    request_on,
    water_edge_of,
)

CRUISING, RESTING = BoatState(0.0, 0.0, 0.0, 0.6), BoatState(0.0, 0.0, 0.0)
AHEAD = GuidanceSetpoint(0.0, 0.6)
HALF_BEAM_M, LENGTH_M = 0.9, 13.0
PLAN_S = 2 * STEP_S


def vessel_from(
    bearing_rad: float, speed_mps: float, in_s: float, label: Label = Label.VESSEL, aside_m: float = 0.0
) -> DynamicObstacle:
    """The bow of a vessel that passes the origin that far aside in so many seconds."""
    ahead, across = np.array([math.cos(bearing_rad), math.sin(bearing_rad)]), np.zeros(2)
    across[:] = -ahead[1], ahead[0]
    bow = ahead * speed_mps * in_s + across * aside_m
    outline = [bow + each * across for each in np.linspace(-HALF_BEAM_M, HALF_BEAM_M, 9)]
    velocity = Velocity(-speed_mps * float(ahead[0]), -speed_mps * float(ahead[1]), 0.2)
    easts, norths = np.array(outline).T
    return DynamicObstacle(easts, norths, 0.2, velocity, 0.1, frozenset(), label=label)


def evaluate(
    vessel: DynamicObstacle, start: BoatState = RESTING, grid: OccupancyGrid | None = None
) -> CandidateEvaluation:
    return evaluate_candidates(request_on(grid or open_water(), start, AHEAD, None, PLANNER, (vessel,)))


def gap_m(boat: BoatState, bow: DynamicObstacle) -> float:
    """From the boat's middle to the side of a vessel with this bow, of `LENGTH_M`."""
    speed_mps = bow.velocity.speed_mps
    east, north = bow.velocity.east_mps / speed_mps, bow.velocity.north_mps / speed_mps
    x_m, y_m = boat.x_m - float(bow.east_m.mean()), boat.y_m - float(bow.north_m.mean())
    along_m, aside_m = x_m * east + y_m * north, abs(y_m * east - x_m * north)
    return math.hypot(max(along_m, 0.0, -LENGTH_M - along_m), max(aside_m - HALF_BEAM_M, 0.0))


class Escape(NamedTuple):
    """`gap_m` at the least, and how often a plan turned by more than a radian off the one before."""

    least_m: float
    turns: int


def escape_from(
    vessel: DynamicObstacle, start: BoatState, setpoint: GuidanceSetpoint = AHEAD, wavering_mps: float = 0.0
) -> Escape:
    """Ten seconds of a boat that moves as the planner expects and is given a plan every `PLAN_S`.

    wavering_mps: by which the velocity is measured across to one side, and in the next plan to the other.
    """
    boat, previous, least_m, turns, true = start, None, math.inf, 0, vessel.velocity
    for number in range(round(10.0 / PLAN_S)):
        now_s, off = number * PLAN_S, wavering_mps / true.speed_mps * (-1.0) ** number
        east_m, north_m = (at + now_s * by for at, by in zip((vessel.east_m, vessel.north_m), true[:2], strict=True))
        measured = true._replace(
            east_mps=true.east_mps - off * true.north_mps, north_mps=true.north_mps + off * true.east_mps
        )
        seen = vessel._replace(east_m=east_m, north_m=north_m, velocity=measured)
        least_m = min(least_m, gap_m(boat, seen._replace(velocity=true)))
        memory = observe_from(BoatPose(boat.x_m, boat.y_m, boat.yaw_rad))
        grid = build_occupancy_grid(memory.observations, (boat.x_m, boat.y_m), START_US, CAMERA, PLANNER)
        plan = plan_on(grid, boat, setpoint, previous, PLANNER, (seen,))
        if previous is not None and previous.speed_mps > 0.0 < plan.speed_mps:
            turns += abs(wrap_rad(plan.heading_rad - previous.heading_rad)) > 1.0
        boat, previous = moved(moved(boat, plan, PLANNER), plan, PLANNER), plan
    return Escape(least_m, turns)


@pytest.mark.slow
@pytest.mark.parametrize("start", [RESTING, CRUISING], ids=["at rest", "under way"])
@pytest.mark.parametrize("speed_mps", [1.0, 1.5, 2.2, 3.0])
@pytest.mark.parametrize("bearing_deg", [0.0, 15.0, -25.0, 60.0, -90.0])
def test_a_vessel_that_is_known_for_six_seconds_strikes_nobody(
    start: BoatState, speed_mps: float, bearing_deg: float
) -> None:
    vessel = vessel_from(math.radians(bearing_deg), speed_mps, 6.0, aside_m=0.3)
    assert escape_from(vessel, start).least_m > 0.45


@pytest.mark.slow
@pytest.mark.parametrize("speed_mps", [1.5, 2.2])
@pytest.mark.parametrize("bearing_deg", [0.0, 15.0, -25.0])
@pytest.mark.parametrize("advised_side", [1.0, -1.0])
def test_it_strikes_nobody_who_is_advised_to_turn_slowly(
    bearing_deg: float, speed_mps: float, advised_side: float
) -> None:
    """It is left at the speed of the course; at that of an advised turn, it strikes."""
    vessel = vessel_from(math.radians(bearing_deg), speed_mps, 6.0, aside_m=0.3)
    turning = GuidanceSetpoint(0.0, 0.15, advised_side)
    assert escape_from(vessel, RESTING, turning._replace(escape_mps=0.6)).least_m > 0.45
    assert escape_from(vessel, RESTING, turning).least_m < 0.45


@pytest.mark.slow
@pytest.mark.parametrize("bearing_deg", [60.0, 90.0, 120.0, -60.0, -90.0, -120.0])
def test_what_drifts_up_to_a_boat_is_left_faster_than_an_advised_turn(bearing_deg: float) -> None:
    """A boat that turns slowly finds no way out of it in time, lies there, and is struck."""
    drifting = vessel_from(math.radians(bearing_deg), 0.13, 1.0 / 0.13)
    drifting = drifting._replace(velocity=drifting.velocity._replace(deviation_mps=0.03))
    turning = GuidanceSetpoint(0.0, 0.15, 1.0)
    assert escape_from(drifting, RESTING, turning._replace(escape_mps=0.3)).least_m > 0.4
    assert escape_from(drifting, RESTING, turning).least_m < 0.1


@pytest.mark.long
@pytest.mark.slow
def test_fewer_strike_who_leaves_faster_than_its_course() -> None:
    """Known 4 s before, of vessels from five bearings at four speeds: 19 of 40 strike at 0.6 m/s, and 14 at 0.9."""
    struck = {
        escape_mps: sum(
            escape_from(
                vessel_from(math.radians(bearing_deg), speed_mps, 4.0, aside_m=0.3),
                start,
                GuidanceSetpoint(0.0, 0.6, escape_mps=escape_mps),
            ).least_m
            < 0.45
            for start in (RESTING, CRUISING)
            for bearing_deg in (0.0, 15.0, -25.0, 60.0, -90.0)
            for speed_mps in (1.0, 1.5, 2.2, 3.0)
        )
        for escape_mps in (0.6, 0.9)
    }
    assert struck[0.9] <= struck[0.6] - 3


@pytest.mark.slow
def test_a_way_out_is_kept_though_the_velocity_is_measured_now_to_one_side_and_now_to_the_other() -> None:
    escapes = [
        escape_from(vessel_from(math.radians(bearing_deg), speed_mps, 6.0, aside_m=aside_m), RESTING, wavering_mps=0.25)
        for bearing_deg in (0.0, 15.0, -25.0, 60.0, -90.0)
        for speed_mps in (1.5, 2.2)
        for aside_m in (0.0, 0.5)
    ]
    assert sum(each.turns for each in escapes) <= 1.5 * len(escapes)
    assert sum(each.least_m < 0.45 for each in escapes) <= 4


@settings(max_examples=40, deadline=None)
@given(
    bearing_rad=st.floats(-2.0, 2.0),
    speed_mps=st.floats(0.0, 3.0),
    aside_m=st.floats(-5.0, 5.0),
    label=st.sampled_from([Label.VESSEL, Label.PERSON]),
    surge_mps=st.floats(0.0, 0.6),
    escape_mps=st.sampled_from([0.6, 0.9]),
)
@pytest.mark.slow
def test_nothing_else_is_left_faster_than_was_asked_for(
    bearing_rad: float, speed_mps: float, aside_m: float, label: Label, surge_mps: float, escape_mps: float
) -> None:
    vessel, start = vessel_from(bearing_rad, speed_mps, 5.0, label, aside_m), RESTING._replace(surge_mps=surge_mps)
    turning = GuidanceSetpoint(0.0, 0.3, 1.0)
    slow, fast = (
        judge_candidates(request_on(open_water(), start, each, None, PLANNER, (vessel,)))
        for each in (turning, turning._replace(escape_mps=escape_mps))
    )
    assert slow is not None
    assert fast is not None
    is_caught = slow.evaluation.is_give_way_needed and any_refusal(slow.refusals).all()
    if is_caught or slow.evaluation.runs_down.any():
        assert fast.evaluation.speeds_mps.max() == escape_mps
    else:
        assert fast.cheapest_plan() == slow.cheapest_plan()
        assert fast.evaluation.speeds_mps.max() == 0.3


@pytest.mark.parametrize(
    ("basis_mps", "asked_mps", "escape_mps", "ordered_mps"),
    [
        (0.3, 0.3, 0.6, 0.6),  # a plan that leads out of the way
        (0.3, 0.15, 0.3, 0.3),  # somebody is near by now
        (0.3, 0.3, 0.0, 0.3),  # the boat is asked to look, where it is
        (0.6, 0.3, 0.6, 0.3),  # the plan of a course that is turned off now
        (0.6, 0.6, 0.6, 0.6),
    ],
)
def test_a_plan_in_force_is_as_fast_as_is_allowed_now(
    basis_mps: float, asked_mps: float, escape_mps: float, ordered_mps: float
) -> None:
    basis = PlanBasis(
        start=RESTING, speed_mps=basis_mps, is_pivot_only=False, previous=None, may_wait=True, map_offset_m=(0.0, 0.0)
    )
    memory = observe_from()
    state = PlannerState(memory, Plan(0.5, 0.6), 0.0, 1.0, START_US, None, memory.frame_id, basis=basis)
    asked = GuidanceSetpoint(0.0, asked_mps, 1.0, escape_mps=escape_mps)
    after, plan = replan(state, odometry(START_US, BoatPose(0.0, 0.0, 0.0)), asked, START_US, CAMERA, PLANNER)
    assert after is state
    assert plan == Plan(0.5, ordered_mps)


@settings(max_examples=40, deadline=None)
@given(
    bearing_rad=st.floats(-2.0, 2.0),
    speed_mps=st.floats(0.9, 3.0),
    in_s=st.floats(4.0, 9.0),
    aside_m=st.floats(-1.2, 1.2),
    surge_mps=st.floats(0.0, 0.6),
)
@pytest.mark.slow
def test_a_boat_is_never_left_at_rest_before_what_runs_it_down(
    bearing_rad: float, speed_mps: float, in_s: float, aside_m: float, surge_mps: float
) -> None:
    """In open water it goes, on a path of which a blow is at most 0.35 more probable than on any other."""
    vessel = vessel_from(bearing_rad, speed_mps, in_s, aside_m=aside_m)
    start = RESTING._replace(surge_mps=surge_mps)
    judged = judge_candidates(request_on(open_water(), start, AHEAD, None, PLANNER, (vessel,)))
    assert judged is not None
    assume(judged.evaluation.runs_down.any())
    assert judged.cheapest_plan().speed_mps > 0.0
    feasible = ~any_refusal(judged.refusals)
    chosen = int(np.where(feasible, judged.costs.total, np.inf).argmin())
    collision = find_passages(judged.evaluation).collision[0]
    assert collision[chosen] <= collision[feasible].min() + 0.35
    assert feasible[judged.evaluation.is_full_speed].any()


@pytest.mark.parametrize(
    ("label", "speed_mps", "deviation_mps", "aside_m", "runs_down"),
    [
        (Label.VESSEL, 2.0, 0.2, 0.0, True),
        (Label.BUOY, 2.0, 0.2, 0.0, True),  # what goes like that is none, whatever the detector calls it
        (Label.PERSON, 2.0, 0.2, 0.0, False),
        (Label.PERSON, 2.3, 0.2, 0.0, True),  # nobody swims like that: it is somebody aboard
        (Label.VESSEL, 0.55, 0.05, 0.0, False),  # the boat is as fast
        (Label.VESSEL, 0.7, 0.26, 0.0, False),  # it may be adrift
        (Label.VESSEL, 2.0, 0.2, 3.5, False),  # it passes by
    ],
)
def test_what_runs_a_boat_down_is_fast_for_certain_and_not_a_person(
    label: Label, speed_mps: float, deviation_mps: float, aside_m: float, *, runs_down: bool
) -> None:
    """Everything else refuses candidates as before."""
    found = vessel_from(0.0, speed_mps, 5.0, label, aside_m)
    found = found._replace(velocity=found.velocity._replace(deviation_mps=deviation_mps))
    evaluation = evaluate(found)
    assert evaluation.runs_down.tolist() == [runs_down]
    assert len(evaluation.dynamic.candidates_m) == (0 if runs_down else 1)


def test_it_is_left_to_any_side_and_right_round() -> None:
    """A boat that nothing runs down does not circle through the side that its course lies off (`span_deg`)."""
    turned = RESTING._replace(yaw_rad=2.2)
    found = [
        evaluate_candidates(request_on(open_water(), turned, AHEAD, None, PLANNER, vessels))
        for vessels in ((), (vessel_from(0.0, 2.0, 5.0),))
    ]
    refused = [hard_constraints(each)[Constraint.TURN][~each.is_pivot].any() for each in found]
    assert [each.runs_down.any() for each in found] == [False, True]
    assert refused == [True, False]


@settings(max_examples=25, deadline=None)
@given(bearing_rad=st.floats(-1.5, 1.5), side_m=st.floats(0.75, 1.9), in_s=st.floats(2.0, 8.0))
@pytest.mark.slow
def test_nobody_is_fled_from_into_what_stands_beside_the_boat(bearing_rad: float, side_m: float, in_s: float) -> None:
    """A plan before a vessel that runs the boat down keeps off a wall beside it as a plan without the vessel may."""
    edge = water_edge_of(BoatPose(0.0, 0.0, 0.0), ((0.8, side_m, 6.0, side_m + 0.6),))
    grid = build_occupancy_grid(observe_from(edge=edge).observations, (0.0, 0.0), START_US, CAMERA, PLANNER)
    evaluation = evaluate(vessel_from(bearing_rad, 2.0, in_s), grid=grid)
    alone = evaluate_candidates(request_on(grid, RESTING, AHEAD, None, PLANNER))
    with_vessel, without = hard_constraints(evaluation), hard_constraints(alone)
    assert evaluation.runs_down.all()
    assert all((with_vessel[name] == without[name]).all() for name in with_vessel)
    assert (evaluation.static_clearance_m == alone.static_clearance_m).all()


def test_the_probability_of_a_blow_falls_with_the_distance_and_rises_with_what_is_unknown() -> None:
    by_aside = [
        find_passages(evaluate(vessel_from(0.0, 2.0, 5.0, aside_m=each))).collision[0, 0]
        for each in (0.0, 1.4, 2.5, 4.0)
    ]
    assert by_aside == sorted(by_aside, reverse=True)
    assert by_aside[0] > 0.5
    assert by_aside[-1] < 0.2
    far = vessel_from(0.0, 2.0, 5.0, aside_m=2.5)
    known, hardly = (
        find_passages(evaluate(far._replace(velocity=far.velocity._replace(deviation_mps=each)))).collision[0, 0]
        for each in (0.05, 0.5)
    )
    assert known < hardly


@pytest.mark.parametrize(
    ("speed_mps", "aside_m", "is_weighed"), [(2.0, 0.0, True), (2.0, 2.5, True), (0.5, 0.0, False)]
)
def test_a_blow_is_weighed_of_what_cannot_be_outrun(speed_mps: float, aside_m: float, *, is_weighed: bool) -> None:
    """Of that also where a boat at rest would be passed by: it is not steered back into. What is slow is kept off."""
    found = vessel_from(0.0, speed_mps, 5.0, aside_m=aside_m)
    found = found._replace(velocity=found.velocity._replace(deviation_mps=0.1))
    assert bool(find_passages(evaluate(found)).collision.max() > 0.05) is is_weighed


@pytest.mark.parametrize("label", [Label.VESSEL, Label.BUOY, Label.PERSON])
@pytest.mark.slow
def test_what_refuses_nothing_is_weighed(label: Label) -> None:
    """However fast it is, and however well that is known, an obstacle refuses candidates or costs them something."""
    count, least_mps = 0, SWIMMING_MPS if label is Label.PERSON else UNDER_WAY_MPS[1]
    for speed_mps in np.linspace(0.3, 2.5, 12).tolist():
        for deviation_mps in (0.05, 0.2, 0.4, 0.8, 1.2):
            found = vessel_from(0.0, speed_mps, 5.0, label)
            found = found._replace(velocity=found.velocity._replace(deviation_mps=deviation_mps))
            evaluation = evaluate(found)
            if evaluation.runs_down.any():
                count += 1
                assert speed_mps - 2.0 * deviation_mps > least_mps
                assert find_passages(evaluation).collision.max() > 0.3
    assert count > 3


def test_the_gap_is_that_to_the_outline() -> None:
    """What the closed loop above measures by."""
    vessel = vessel_from(0.0, 1.0, 5.0)
    ahead_m = predicted_clearance_m(vessel, np.zeros(1), np.zeros(1), np.zeros(1))[0]
    assert gap_m(RESTING, vessel) == pytest.approx(5.0)
    assert ahead_m < 5.0
    assert gap_m(BoatState(8.0, 2.0, 0.0), vessel) == pytest.approx(2.0 - HALF_BEAM_M)
