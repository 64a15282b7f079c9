"""The planner among dynamic obstacles: plans keep clear of where they will be."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from paani.messages import Label
from paani_services.navigator.avoidance.clearance import UNSEEN_GROWTH_MPS, margins, predicted_clearance_m
from paani_services.navigator.avoidance.evaluation import evaluate_candidates
from paani_services.navigator.avoidance.replanning import PlannerState, replan
from paani_services.navigator.avoidance.rollout import (
    BoatState,
    GuidanceSetpoint,
    Plan,
    Trajectories,
    roll_out,
    roll_out_coasting,
)
from paani_services.navigator.mapping.dynamic_obstacles import DynamicObstacle
from paani_services.navigator.mapping.observation import ObservationMemory
from paani_services.navigator.mapping.occupancy_grid import OccupancyGrid, build_occupancy_grid
from paani_services.navigator.mapping.velocity_fit import Velocity
from paani_sim.eye.camera import BoatPose
from tests.synthetic_water import (
    AT_REST,
    CAMERA,
    PLANNER,
    START_US,
    detection_of,
    observe_from,
    odometry,
    open_water,
    plan_on,
    request_on,
    static_distances_m,
    water_edge_of,
)

CRUISING, RESTING = BoatState(0.0, 0.0, 0.0, 0.6), BoatState(0.0, 0.0, 0.0)
AHEAD = GuidanceSetpoint(0.0, 0.6)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_boat_waits_for_a_crossing_swimmer_and_passes_behind(side: float) -> None:
    """Under way on open water it waits, or brakes and looks round, and lets the swimmer pass."""
    grid = open_water()
    found = [
        plan_on(grid, CRUISING, AHEAD, None, PLANNER, (swimmer(3.0, side * y_m, 0.0, side * 0.35),))
        for y_m in (-2.0, -1.0, 0.0, 0.5, 1.5)
    ]
    assert [each.speed_mps for each in found] == [0.06, 0.0, 0.06, 0.3, 0.3]
    assert all(side * each.heading_rad < 0.2 for each in found[3:])


def test_a_person_who_may_swim_but_does_not_is_passed_in_the_end() -> None:
    """A person who treads water, or is a false detection, is a static obstacle once the boat may wait no longer."""
    grid = open_water()
    person = DynamicObstacle(np.array([2.8]), np.array([0.5]), 0.5, Velocity(0.0, 0.0, 0.2), 0.1, frozenset())
    found = [plan_on(grid, RESTING, AHEAD, None, PLANNER, (person,), may_wait=patient) for patient in (True, False)]
    assert [each.speed_mps > 0.0 for each in found] == [False, True]
    crossing = swimmer(3.0, -1.0, 0.0, 0.35)
    assert plan_on(grid, CRUISING, AHEAD, None, PLANNER, (crossing,), may_wait=False).speed_mps <= 0.3


def test_a_boat_waits_for_patience_s_at_most() -> None:
    """A person 3.6 m ahead, seen twice, may swim anywhere: the boat waits, unless it has for `patience_s`.

    Since a time in the future is since now: the clock was set back.
    """
    place = (3.6, 0.3, 4.0, 0.9)
    memory, now_us = ObservationMemory(), START_US
    for now_us in (START_US, START_US + 200_000):
        memory = observe_from(
            edge=water_edge_of(AT_REST, (place,)), at_us=now_us, memory=memory, detections=(detection_of(place, 0.4),)
        )
    here = odometry(now_us, AT_REST)
    patience_s = PLANNER.patience_s
    for waited_s, moves in ((None, False), (patience_s - 1.0, False), (patience_s + 1.0, True), (-3600.0, False)):
        waiting_since_us = None if waited_s is None else now_us - round(waited_s * 1e6)
        since_us = now_us if waiting_since_us is None else min(waiting_since_us, now_us)
        state, found = replan(
            PlannerState(memory, waiting_since_us=waiting_since_us), here, AHEAD, now_us, CAMERA, PLANNER
        )
        assert (found.speed_mps > 0.0) is moves
        assert state.waiting_since_us == (None if moves else since_us)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_boat_at_rest_gives_way_to_a_vessel_that_drifts_onto_it(side: float) -> None:
    """A kayak 2 m wide comes at 0.13 m/s and will be there in 20 s: the boat leaves while there is room to turn."""
    grid = open_water()
    outline = (np.full(9, 3.8), side * 0.3 + np.linspace(-1.0, 1.0, 9))
    kayak = DynamicObstacle(*outline, 0.2, Velocity(-0.13, 0.0, 0.03), 0.1, frozenset())
    found = plan_on(grid, RESTING, AHEAD, None, PLANNER, (kayak,))
    assert found.speed_mps > 0.0
    assert found.heading_rad * side < -0.8


def test_uncertainty_grows_with_the_time_out_of_sight() -> None:
    now, later = (
        predicted_clearance_m(swimmer(4.0, 0.0, 0.0, 0.0, age_s), np.zeros(1), np.zeros(1), np.zeros(1))[0]
        for age_s in (0.0, 12.0)
    )
    assert now - later == pytest.approx(12.0 * (UNSEEN_GROWTH_MPS + 0.05))


def swimmer(x_m: float, y_m: float, east_mps: float, north_mps: float, age_s: float = 0.1) -> DynamicObstacle:
    velocity = Velocity(east_mps, north_mps, 0.05)
    return DynamicObstacle(np.array([x_m]), np.array([y_m]), 0.5, velocity, age_s, frozenset(), label=Label.PERSON)


def least_gap_m(found: Plan, start: BoatState, obstacle: DynamicObstacle) -> float:
    """Least distance between the middles of boat and obstacle over six seconds of the plan, or at rest."""
    time_s = np.arange(0.0, 6.0, 0.1)
    if found.speed_mps > 0.0:
        trajectories = roll_out(start, np.array([found.heading_rad]), np.array([found.speed_mps]), PLANNER)
        x_m, y_m = (np.interp(time_s, trajectories.time_s, axis[:, 0]) for axis in (trajectories.x_m, trajectories.y_m))
    else:
        x_m, y_m = np.full_like(time_s, start.x_m), np.full_like(time_s, start.y_m)
    easts, norths = (
        obstacle.east_m[0] + time_s * obstacle.velocity.east_mps,
        obstacle.north_m[0] + time_s * obstacle.velocity.north_mps,
    )
    return float(np.hypot(x_m - easts, y_m - norths).min())


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_crossing_swimmer_is_passed_astern(side: float) -> None:
    """A static swimmer would be passed on the other side; one who crosses the bow from `side` is passed behind."""
    crossing = swimmer(4.5, side * 1.5, 0.0, -side * 0.35)
    found = plan_on(open_water(), CRUISING, AHEAD, None, PLANNER, (crossing,))
    assert found.speed_mps > 0.0
    assert found.heading_rad * side > 0.05
    standing = swimmer(4.5, side * 0.3, 0.0, 0.0)
    assert plan_on(open_water(), CRUISING, AHEAD, None, PLANNER, (standing,)).heading_rad * side < 0.0


def test_an_obstacle_that_has_passed_by_then_changes_nothing() -> None:
    """It crosses the course, but is past before the boat comes."""
    gone = swimmer(5.5, 0.6, 0.0, 0.6)
    assert plan_on(open_water(), CRUISING, AHEAD, None, PLANNER, (gone,)) == Plan(0.0, 0.6)


def test_head_on_the_boat_turns_or_stops() -> None:
    for ahead_m in (3.0, 4.0, 5.0):
        oncoming = swimmer(ahead_m, 0.0, -0.4, 0.0)
        found = plan_on(open_water(), CRUISING, AHEAD, None, PLANNER, (oncoming,))
        assert found.speed_mps == 0.0 or abs(found.heading_rad) > 0.1
        straight = least_gap_m(Plan(0.0, 0.6), CRUISING, oncoming)
        assert least_gap_m(found, CRUISING, oncoming) > straight + 0.3


def test_a_boat_at_rest_gives_way_to_a_swimmer_from_the_side() -> None:
    """The boat moves to where the swimmer comes no nearer than to a waiting boat."""
    coming = swimmer(0.3, 2.2, 0.0, -0.4)
    found = plan_on(open_water(), RESTING, AHEAD, None, PLANNER, (coming,))
    assert found.speed_mps > 0.0
    assert least_gap_m(found, RESTING, coming) > least_gap_m(Plan(0.0, 0.0), RESTING, coming) + 0.3


def test_an_obstacle_out_of_sight_for_unseen_s_counts_no_more() -> None:
    crossing = swimmer(3.0, 0.3, 0.0, -0.1, PLANNER.unseen_s + 0.1)
    assert plan_on(open_water(), CRUISING, AHEAD, None, PLANNER, (crossing,)) == Plan(0.0, 0.6)


@pytest.mark.slow
@settings(max_examples=25, deadline=None)
@given(
    bar=st.tuples(st.floats(1.5, 7.0), st.floats(-3.0, 3.0), st.floats(0.3, 2.0), st.floats(0.3, 2.0)),
    bank_m=st.floats(1.5, 9.0),
    place=st.tuples(st.floats(1.0, 6.0), st.floats(-3.0, 3.0)),
    velocity=st.tuples(st.floats(-0.6, 0.6), st.floats(-0.6, 0.6)),
    surge=st.floats(0.0, 0.6),
)
@example(bar=(2.0, 0.0, 1.0, 1.0), bank_m=2.0, place=(2.0, 0.5), velocity=(-0.125, 0.0), surge=0.0)
def test_a_dynamic_obstacle_makes_no_candidate_feasible_but_one_wider_than_coasting(
    bar: tuple[float, float, float, float],
    bank_m: float,
    place: tuple[float, float],
    velocity: tuple[float, float],
    surge: float,
) -> None:
    """A plan with a dynamic obstacle is feasible without it too, and comes no nearer to it than a boat at rest would.

    A boat that it will reach turns away, and may come as near as hull and half a cell. The only exception keeps further
    off everything than coasting would.
    """
    x, y, deep, wide = bar
    memory = observe_from(edge=water_edge_of(BoatPose(0.0, 0.0, 0.0), ((x, y, x + deep, y + wide),), bank_m))
    grid, start = (
        build_occupancy_grid(memory.observations, (0.0, 0.0), START_US, CAMERA, PLANNER),
        BoatState(0.0, 0.0, 0.0, surge),
    )
    obstacle = swimmer(*place, *velocity)
    found = plan_on(grid, start, AHEAD, None, PLANNER, (obstacle,))
    if found.speed_mps == 0.0:
        return
    trajectories = roll_out(start, np.array([found.heading_rad]), np.array([found.speed_mps]), PLANNER)
    soon = trajectories.time_s <= PLANNER.horizon_s
    time_s = trajectories.time_s[soon, None]
    gap_m = predicted_clearance_m(obstacle, trajectories.x_m[soon], trajectories.y_m[soon], time_s)[:, 0]
    rest_m = np.minimum.accumulate(
        predicted_clearance_m(obstacle, np.zeros_like(time_s), np.zeros_like(time_s), time_s)[:, 0]
    )
    is_reached = evaluate_candidates(request_on(grid, start, AHEAD, obstacles=(obstacle,))).is_give_way_needed
    least = margins(PLANNER)[-1]
    enough_m = least.hull_radius_m + least.margin_m if is_reached else 1.0
    keeps = (gap_m >= np.minimum(enough_m, np.maximum(rest_m - 0.1, 0.0)) - 1e-9).all()
    if not keeps or plan_on(grid, start, AHEAD, None, PLANNER).speed_mps == 0.0:
        assert least_m(grid, obstacle, trajectories) > least_m(
            grid, obstacle, roll_out_coasting(start, trajectories.time_s, PLANNER)
        )


def least_m(grid: OccupancyGrid, obstacle: DynamicObstacle, trajectories: Trajectories) -> float:
    """Least clearance within the horizon, to this obstacle and to static ones up to 2 m off."""
    soon = trajectories.time_s <= PLANNER.horizon_s + 1e-9
    standing = static_distances_m(grid, trajectories)[soon].min(initial=2.0)
    return float(
        min(
            standing,
            predicted_clearance_m(
                obstacle, trajectories.x_m[soon], trajectories.y_m[soon], trajectories.time_s[soon, None]
            ).min(),
        )
    )
