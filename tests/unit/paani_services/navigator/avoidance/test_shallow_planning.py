"""The planner before shallow water: it turns or stops, says why, and is never less cautious than without soundings."""

from __future__ import annotations

import math

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from paani.config import NavigatorConfig
from paani.geometry import wrap_rad
from paani.messages import Constraint, NavCommand, Occupancy, SoundingStatus
from paani.occupancy_cells import unpack_cells
from paani_services.navigator.avoidance.evaluation import evaluate_candidates
from paani_services.navigator.avoidance.replanning import PlannerState, explain_plan, replan
from paani_services.navigator.avoidance.request import PlanRequest
from paani_services.navigator.avoidance.rollout import PIVOT_SPEED_FRACTION, BoatState, GuidanceSetpoint, Plan
from paani_services.navigator.mapping.shallow_cells import apply_shallow_cells
from paani_services.navigator.mapping.soundings import ShallowCell, SoundingMemory
from paani_services.navigator.mapping.water_map import map_water
from paani_services.navigator.navigate import NavigatorState
from paani_services.navigator.occupancy import occupancy_around
from paani_services.navigator.predict import predict
from paani_sim.eye.camera import BoatPose
from tests.synthetic_water import CAMERA, PLANNER, START_US, observe_from, odometry

HERE = replace(odometry(START_US, BoatPose(0.0, 0.0, 0.0)), surge_mps=0.6)
AHEAD = GuidanceSetpoint(0.0, 0.6)
FIVE_M = 5  # cells of 0.4 m: the column 2 m ahead
Numbers = list[tuple[int, int]]


def remembered(numbers: Numbers) -> SoundingMemory:
    cells = tuple(ShallowCell(*number, START_US, True) for number in numbers)
    return SoundingMemory(SoundingStatus.OK, START_US, 1.5, cells=cells)


def planned(numbers: Numbers) -> tuple[PlannerState, Plan]:
    state = PlannerState(observe_from(), soundings=remembered(numbers))
    return replan(state, HERE, AHEAD, START_US, CAMERA, PLANNER)


def test_the_boat_turns_before_shallow_water_and_makes_no_way_where_it_is_all_around() -> None:
    assert planned([])[1].heading_rad == pytest.approx(0.0, abs=0.01)
    _, beside = planned([(FIVE_M, row) for row in range(-1, 2)])
    assert math.degrees(abs(wrap_rad(beside.heading_rad))) > 15.0
    assert beside.speed_mps > 0.0
    ring = [(x, y) for x in range(-6, 7) for y in range(-6, 7) if max(abs(x), abs(y)) >= 4]
    assert planned(ring)[1].speed_mps <= PIVOT_SPEED_FRACTION * AHEAD.speed_mps


def test_shallow_water_far_away_changes_nothing() -> None:
    assert planned([(60, 0), (0, 40), (-5000, 3)])[1] == planned([])[1]


def test_the_reasons_are_told_from_what_was_recorded() -> None:
    """What was shallow is part of the plan's basis, so the plan can be made again when more is known."""
    state, _ = planned([(FIVE_M, row) for row in range(-1, 2)])
    later = replace(state, soundings=remembered([]))
    verdicts = explain_plan(later, CAMERA, PLANNER)
    ahead = next(each for each in verdicts if abs(each.heading_rad) < 0.01)
    assert Constraint.STATIC_OBSTACLE in ahead.refused_by
    assert state.basis is not None
    assert explain_plan(replace(state, basis=replace(state.basis, shallow=())), CAMERA, PLANNER) == ()


def test_people_see_the_shallow_water_on_the_grid_and_the_depth() -> None:
    state, plan = planned([(FIVE_M, 0)])
    grid = occupancy_around(state, HERE, START_US, CAMERA, NavigatorConfig())
    assert grid is not None
    column = math.floor((2.1 - grid.west_m) / grid.cell_m)
    row = math.floor((0.1 - grid.south_m) / grid.cell_m)
    assert unpack_cells(grid)[row, column] == Occupancy.OCCUPIED
    order = NavCommand(source_us=START_US, enable=True, heading_rad=plan.heading_rad, speed_mps=plan.speed_mps)
    ahead = predict(NavigatorState(planner_state=state), order, HERE, None, START_US, CAMERA, NavigatorConfig())
    assert (ahead.soundings, ahead.depth_m) == (SoundingStatus.OK, 1.5)


@given(st.lists(st.tuples(st.integers(-25, 25), st.integers(-25, 25)), max_size=40))
@pytest.mark.slow
def test_no_candidate_has_more_room_with_soundings_than_without(numbers: Numbers) -> None:
    grid, obstacles = map_water(observe_from().observations, (0.0, 0.0), START_US, CAMERA, PLANNER)
    start = BoatState(0.0, 0.0, 0.0, 0.6, 0.0, 0.0)
    request = PlanRequest(grid=grid, start=start, setpoint=AHEAD, config=PLANNER, obstacles=obstacles)
    without = evaluate_candidates(request)
    with_soundings = evaluate_candidates(replace(request, grid=apply_shallow_cells(grid, tuple(numbers))))
    assert (with_soundings.static_clearance_m <= without.static_clearance_m + 1e-12).all()
    assert (with_soundings.clearance_m <= without.clearance_m + 1e-12).all()
    assert (with_soundings.person_distance_m == without.person_distance_m).all()


def test_the_memory_is_recorded_as_it_is() -> None:
    memory = remembered([(FIVE_M, -3), (2, 2)])
    assert msgspec.json.decode(msgspec.json.encode(memory), type=SoundingMemory) == memory
