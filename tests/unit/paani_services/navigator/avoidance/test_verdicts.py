"""Every heading keeps the constraint that refused it, or what it costs; and the plan is the cheapest of them."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from paani.geometry import wrap_rad
from paani.messages import Constraint, HeadingVerdict
from paani_services.navigator.avoidance.constraints import hard_constraints
from paani_services.navigator.avoidance.planner import judge_candidates
from paani_services.navigator.avoidance.rollout import BoatState, GuidanceSetpoint, Plan
from paani_services.navigator.mapping.dynamic_obstacles import DynamicObstacle
from paani_services.navigator.mapping.observed_cells import CELL_M
from paani_services.navigator.mapping.occupancy_grid import GRID_CELLS, OccupancyGrid
from paani_services.navigator.mapping.velocity_fit import Velocity
from tests.synthetic_water import PLANNER, explain_motion, pool, request_on

CRUISING, RESTING = BoatState(0.0, 0.0, 0.0, 0.6), BoatState(0.0, 0.0, 0.0)
AHEAD = GuidanceSetpoint(0.0, 0.6)
SPAN = range(GRID_CELLS)


def basin(occupied: np.ndarray, people: np.ndarray | None = None) -> OccupancyGrid:
    """A grid around the origin where everything that is not occupied is free."""
    none = np.zeros_like(occupied)
    seen = none if people is None else people
    return OccupancyGrid(-10.0, -10.0, occupied, none, ~occupied, none, seen, none, seen)


def wall(rows: range = SPAN, columns: range = SPAN) -> np.ndarray:
    """These cells [north, east]."""
    cells = np.zeros((GRID_CELLS, GRID_CELLS), np.bool_)
    cells[rows.start : rows.stop, columns.start : columns.stop] = True
    return cells


def swimmer(x_m: float, y_m: float, north_mps: float) -> DynamicObstacle:
    return DynamicObstacle(np.array([x_m]), np.array([y_m]), 0.5, Velocity(0.0, north_mps, 0.05), 0.1, frozenset())


def total(verdict: HeadingVerdict) -> float:
    return sum(msgspec.structs.astuple(verdict.costs)) if verdict.costs is not msgspec.UNSET else math.inf


@settings(max_examples=25, deadline=None)
@example(bars=[(1.0, 0.0, 1.0, 2.0), (1.0, -2.0, 1.0, 2.0)], place=(1.0, 0.0), course=0.0, surge=0.0, side=-1.0)
@given(
    bars=st.lists(
        st.tuples(st.floats(1.0, 6.0), st.floats(-3.0, 3.0), st.floats(0.3, 2.0), st.floats(0.3, 2.0)), max_size=3
    ),
    place=st.tuples(st.floats(1.0, 6.0), st.floats(-3.0, 3.0)),
    course=st.floats(-3.1, 3.1),
    surge=st.floats(0.0, 0.6),
    side=st.sampled_from([-1.0, 0.0, 1.0]),
)
@pytest.mark.slow
def test_the_plan_is_the_cheapest_heading_that_nothing_refuses(
    bars: list[tuple[float, float, float, float]],
    place: tuple[float, float],
    course: float,
    surge: float,
    side: float,
) -> None:
    grid = pool(*((x, y, x + deep, y + wide) for x, y, deep, wide in bars))
    assume(grid.free.any())  # else no heading is considered
    start, crossing = BoatState(0.0, 0.0, 0.0, surge), swimmer(*place, 0.3)
    plan, verdicts = explain_motion(grid, start, GuidanceSetpoint(course, 0.6, side), None, PLANNER, (crossing,))
    headings = [each.heading_rad for each in verdicts]
    assert headings[0] == pytest.approx(wrap_rad(course))
    assert len(set(headings)) == len(headings) > 20
    for each in verdicts:
        assert (each.costs is msgspec.UNSET) == (each.speed_mps == 0.0) == (Constraint.NONE not in each.refused_by)
    if plan.speed_mps == 0.0:
        assert all(each.costs is msgspec.UNSET for each in verdicts)
    else:
        (chosen,) = (each for each in verdicts if each.heading_rad == plan.heading_rad)
        assert chosen.speed_mps == plan.speed_mps
        assert total(chosen) <= min(map(total, verdicts)) + 0.01  # of rounding


def test_in_open_water_the_course_costs_nothing_and_others_by_name() -> None:
    _, verdicts = explain_motion(pool(), CRUISING, GuidanceSetpoint(0.0, 0.6, 1.0), Plan(0.0, 0.6), PLANNER)
    straight, port, starboard = verdicts[:3]
    assert straight.costs is not msgspec.UNSET
    assert port.costs is not msgspec.UNSET
    assert starboard.costs is not msgspec.UNSET
    assert msgspec.structs.asdict(straight.costs) == {
        "course": 0.0, "progress": 0.0, "heading_change": 0.0, "advice": 0.15, "path_obstacle": 0.0, "margin": 0.0,
        "unknown_water": straight.costs.unknown_water, "proximity": pytest.approx(0.0, abs=0.01),
        "give_way": 0.0, "passing_side": 0.0, "collision": 0.0,
    }  # fmt: skip
    assert port.costs.course == starboard.costs.course == pytest.approx(10.0 / 90.0, abs=1e-3)
    others = sum(msgspec.structs.astuple(port.costs)) - port.costs.heading_change
    assert port.costs.heading_change == pytest.approx((0.15 + 0.1 * others) * 10.0 / 90.0, abs=1e-3)
    assert port.costs.progress == pytest.approx(0.3 * (1.0 - math.cos(math.radians(10.0))), abs=1e-3)
    assert port.costs.advice == pytest.approx(0.15 * (1.0 - 10.0 / 25.0), abs=1e-3)
    assert starboard.costs.advice == 0.15


@settings(max_examples=25, deadline=None)
@given(side=st.sampled_from([1.0, -1.0]), turn_deg=st.floats(20.0, 179.0), speed=st.sampled_from([0, 1, 2]))
@pytest.mark.slow
def test_to_turn_the_other_way_costs_more_than_to_go_straight_on(side: float, turn_deg: float, speed: int) -> None:
    """Though its heading lies beside that of the plan before: what was turned is undone first."""
    water, before = basin(wall(range(0))), Plan(side * math.radians(turn_deg), 0.6)
    judged = judge_candidates(request_on(water, CRUISING, AHEAD, before))
    assert judged is not None
    chosen = judged.evaluation.speeds_mps == judged.evaluation.speeds_mps[speed]
    offsets_rad, changes = judged.evaluation.offsets_rad[chosen], judged.costs.heading_change[chosen]
    other_way = side * offsets_rad < 0.0
    assert other_way.sum() >= 12
    assert (changes[other_way] > changes[offsets_rad == 0.0]).all()


def test_obstacles_cost_what_is_near_and_what_is_further_along_the_path() -> None:
    _, verdicts = explain_motion(pool((3.6, -0.4, 4.2, 0.4)), RESTING, AHEAD, None, PLANNER)
    by_heading = {round(math.degrees(each.heading_rad)): each.costs for each in verdicts}
    near, clear = by_heading[20], by_heading[60]
    assert near is not msgspec.UNSET
    assert clear is not msgspec.UNSET
    assert near.proximity > clear.proximity
    assert near.path_obstacle > clear.path_obstacle == 0.0


def test_water_that_is_not_known_refuses_a_boat_that_could_not_stop() -> None:
    """No picture shows what lies abeam; a boat that may pivot there does not go there at speed."""
    _, verdicts = explain_motion(pool()._replace(blind_zone=wall(range(0), range(0))), CRUISING, AHEAD, None, PLANNER)
    assert {each.refused_by for each in verdicts} == {(Constraint.UNKNOWN_WATER,) * 3}


@pytest.mark.parametrize(("surge_mps", "is_refused"), [(0.6, True), (0.3, False)])
def test_a_slow_order_stops_no_boat_sooner_than_its_way_allows(surge_mps: float, *, is_refused: bool) -> None:
    """The hull reaches unknown water 1.1 m ahead: a boat at 0.6 m/s stops within 1.5 m, one at 0.3 within 0.75 m."""
    ends = wall(columns=range(round((10.0 + 1.1 + PLANNER.hull_radius_m) / CELL_M), GRID_CELLS))
    water = basin(wall(range(0)))._replace(free=~ends)
    judged = judge_candidates(request_on(water, BoatState(0.0, 0.0, 0.0, surge_mps), AHEAD))
    assert judged is not None
    ahead = np.flatnonzero(judged.evaluation.offsets_rad == 0.0)
    assert judged.evaluation.speeds_mps[ahead].tolist() == pytest.approx([0.6, 0.3, 0.06])
    refused = hard_constraints(judged.evaluation)[Constraint.UNKNOWN_WATER][ahead]
    assert refused.tolist() == [True, is_refused, is_refused]


def test_a_wall_refuses_what_leads_to_it_and_a_boat_beside_it_goes_slowly() -> None:
    _, verdicts = explain_motion(basin(wall(columns=range(58, 62))), CRUISING, AHEAD, None, PLANNER)
    assert verdicts[0].refused_by[0] is Constraint.STATIC_OBSTACLE
    _, verdicts = explain_motion(basin(wall(rows=range(52, 60))), RESTING, AHEAD, None, PLANNER)
    assert verdicts[0].refused_by[:2] == (Constraint.TOO_FAST, Constraint.NONE)


def test_people_keep_their_distance_whatever_else_is_there() -> None:
    person = wall(range(48, 52), range(56, 60))
    _, verdicts = explain_motion(basin(person, person), CRUISING, AHEAD, None, PLANNER)
    assert verdicts[0].refused_by[0] is Constraint.PERSON


def test_what_crosses_refuses_the_way_across_its_own_and_a_boat_that_waits_says_so() -> None:
    crossing = swimmer(3.0, -2.0, 0.35)
    plan, verdicts = explain_motion(basin(wall(range(0), range(0))), CRUISING, AHEAD, None, PLANNER, (crossing,))
    assert not plan.is_waiting
    assert Constraint.DYNAMIC_OBSTACLE in verdicts[0].refused_by
    plan, verdicts = explain_motion(pool(), CRUISING, AHEAD, None, PLANNER, (swimmer(3.0, -1.0, 0.35),))
    assert plan.speed_mps == 0.0
    assert {each.refused_by[0] for each in verdicts} <= {Constraint.WAIT, Constraint.UNKNOWN_WATER}
    assert verdicts[0].refused_by[0] is Constraint.WAIT


def test_a_boat_that_faces_away_looks_first() -> None:
    _, verdicts = explain_motion(basin(wall(range(0), range(0))), RESTING, GuidanceSetpoint(2.0, 0.6), None, PLANNER)
    assert verdicts[0].refused_by == (Constraint.LOOK, Constraint.LOOK, Constraint.NONE)


def test_a_turn_that_is_not_asked_for_is_refused_as_such() -> None:
    """A pivot to port is asked for, and no way ahead."""
    look = GuidanceSetpoint(0.0, 0.6, 1.0, is_pivot_only=True)
    plan, verdicts = explain_motion(pool(), RESTING, look, None, PLANNER)
    assert verdicts[0].refused_by == (Constraint.TURN,) * 3
    assert plan.heading_rad > 0.3


def test_out_of_a_corner_without_a_way_nothing_escapes() -> None:
    """The boat lies in a corner that no candidate leads out of, and stops; every heading says why."""
    cells = wall()
    cells[49:51, 49:51] = False
    plan, verdicts = explain_motion(basin(cells), RESTING, GuidanceSetpoint(1.9, 0.3), Plan(0.0, 0.0), PLANNER)
    assert plan.speed_mps == 0.0
    assert {each.speed_mps for each in verdicts} == {0.0}
    assert all(Constraint.NONE not in each.refused_by for each in verdicts)
    assert Constraint.STATIC_OBSTACLE in verdicts[0].refused_by
