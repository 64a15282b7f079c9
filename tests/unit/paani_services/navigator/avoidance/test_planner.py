"""Heading and speed on free water alone (Q4-Q6)."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paani.config import load_config
from paani.messages import Detection, Label
from paani_services.navigator.avoidance.clearance import clearance_fields_m, required_clearance_m
from paani_services.navigator.avoidance.constraints import ESCAPE_TOLERANCE_M, MIN_PIVOT_RAD
from paani_services.navigator.avoidance.rollout import (
    PIVOT_SPEED_FRACTION,
    BoatState,
    GuidanceSetpoint,
    Plan,
    Trajectories,
    roll_out,
    roll_out_coasting,
    sample_candidates,
)
from paani_services.navigator.mapping.observation import ObservationMemory
from paani_services.navigator.mapping.observed_cells import CELL_M
from paani_services.navigator.mapping.occupancy_grid import GRID_CELLS, OccupancyGrid, build_occupancy_grid
from paani_sim.eye.camera import BoatPose, project
from tests.synthetic_water import (
    AT_REST,
    CAMERA,
    EYE,
    PLANNER,
    START_US,
    Bar,
    observe_from,
    plan_on,
    pool,
    static_distances_m,
    water_edge_of,
)

PAPER = load_config(profile="paper").navigator.planner
AHEAD = GuidanceSetpoint(0.0, 0.6)
RESTING, CRUISING = BoatState(0.0, 0.0, 0.0), BoatState(0.0, 0.0, 0.0, 0.6)


def swept_gap_m(grid: OccupancyGrid, start: BoatState, found: Plan) -> tuple[np.ndarray, np.ndarray]:
    """Times, and distances from the middle of the nearest occupied cell, along the whole plan."""
    trajectories = planned_trajectory(start, found)
    return trajectories.time_s, static_distances_m(grid, trajectories)


def planned_trajectory(start: BoatState, found: Plan) -> Trajectories:
    """The trajectory of a plan."""
    off = (found.heading_rad - start.yaw_rad + math.pi) % (2.0 * math.pi) - math.pi
    return roll_out(start, np.array([off]), np.array([found.speed_mps]), PLANNER)


def round_about(occupied: np.ndarray) -> OccupancyGrid:
    """A grid around the origin where everything that is not occupied is free."""
    none = np.zeros_like(occupied)
    return OccupancyGrid(-10.0, -10.0, occupied, none, ~occupied, none, none, none, none)


def bar_on_grid(bar: Bar) -> np.ndarray:
    """The cells of a grid around the origin that a bar covers."""
    west, south, east, north = (round((edge_m + 10.0) / CELL_M) for edge_m in bar)
    occupied = np.zeros((GRID_CELLS, GRID_CELLS), np.bool_)
    occupied[south:north, west:east] = True
    return occupied


def clearance_along_m(grid: OccupancyGrid, start: BoatState, found: Plan) -> np.ndarray:
    """Static clearance along the plan within the horizon; negative inside an obstacle."""
    trajectories = planned_trajectory(start, found)
    column, row = (trajectories.x_m[:, 0] - grid.west_m) / CELL_M, (trajectories.y_m[:, 0] - grid.south_m) / CELL_M
    near = trajectories.time_s <= PLANNER.horizon_s
    return np.asarray(clearance_fields_m(grid, PLANNER)[0][row.astype(int), column.astype(int)][near])


def test_q4_three_seconds_in_steps_of_0_2() -> None:
    """Q4: the swept footprint's horizon and step, in both profiles."""
    for config in (PAPER, PLANNER):
        trajectories = roll_out(RESTING, np.zeros(1), np.array([0.4]), config)
        near = trajectories.time_s[trajectories.time_s <= 3.0 + 1e-9]
        assert near == pytest.approx(np.arange(16) * 0.2)
    assert roll_out(RESTING, np.zeros(1), np.array([0.4]), PAPER).time_s[-1] == pytest.approx(3.0)


@settings(max_examples=25, deadline=None)
@given(
    surge=st.floats(0.0, 0.4),
    rate=st.floats(-0.35, 0.35),
    offset=st.floats(-3.0, 3.0),
    speed=st.floats(0.0, 0.4),
)
@pytest.mark.slow
def test_q5_speed_yaw_rate_and_acceleration(surge: float, rate: float, offset: float, speed: float) -> None:
    """Q5: no trajectory is faster than 0.4 m/s, turns faster than 0.35 rad/s or accelerates by more than 0.2 m/s2."""
    assert (PAPER.speed_mps, PAPER.yaw_rate_radps, PAPER.accel_mps2) == (0.4, 0.35, 0.2)
    start = BoatState(0.0, 0.0, 0.0, surge, rate)
    trajectories = roll_out(start, np.array([offset]), np.array([speed]), PAPER)
    step_s = np.diff(trajectories.time_s)
    speeds = np.concatenate([[surge], np.diff(trajectories.travelled_m[:, 0]) / step_s])
    assert speeds.max() <= 0.4 + 1e-9
    assert np.abs(np.diff(speeds)).max() <= 0.2 * 0.2 + 1e-9
    headings = np.unwrap(np.arctan2(np.diff(trajectories.y_m[:, 0]), np.diff(trajectories.x_m[:, 0])))
    moving = np.diff(trajectories.travelled_m[:, 0]) > 1e-6
    turns = np.abs(np.diff(headings)) / step_s[1:]
    assert turns[moving[1:] & moving[:-1]].max(initial=0.0) <= 0.35 + 1e-6
    assert sample_candidates(start, GuidanceSetpoint(0.3, 5.0), PAPER)[1].max() == 0.4


def test_q6_hull_margin_and_drift() -> None:
    """Q6: 0.55 m hull, 0.25 m margin, 0.15 m/s drift; a boat that is nearer already comes no nearer."""
    time_s = np.array([0.0, 1.0, 2.0, 3.0])
    for config, margin_m in ((PAPER, 0.25), (PLANNER, 0.7)):
        assert required_clearance_m(time_s, 2.0, config) == pytest.approx(0.55 + margin_m + 0.15 * time_s)
        assert required_clearance_m(time_s, 0.7, config) == pytest.approx([0.6, 0.6, 0.6, 0.6])
        assert required_clearance_m(time_s, 0.3, config) == pytest.approx([0.2, 0.2, 0.2, 0.2])


@settings(max_examples=30, deadline=None)
@given(
    bars=st.lists(
        st.tuples(st.floats(1.5, 7.0), st.floats(-3.0, 3.0), st.floats(0.3, 2.0), st.floats(0.3, 2.0)), max_size=4
    ),
    bank_m=st.floats(1.5, 9.0),
    course=st.floats(-3.1, 3.1),
    surge=st.floats(0.0, 0.6),
    side=st.sampled_from([-1.0, 0.0, 1.0]),
)
@pytest.mark.slow
def test_no_plan_enters_an_occupied_cell(
    bars: list[tuple[float, float, float, float]], bank_m: float, course: float, surge: float, side: float
) -> None:
    """Q4, Q6: the swept hull is clear of every occupied cell for 3 s, with half a cell of interpolation error.

    The least clearance is the hull and half a cell. An escape comes hardly nearer to what the boat lies beside.
    """
    least = msgspec.structs.replace(PLANNER, margin_m=0.5 * CELL_M, drift_mps=0.0)
    grid = pool(*((x, y, x + deep, y + wide) for x, y, deep, wide in bars), bank_m=bank_m)
    start = BoatState(0.0, 0.0, 0.0, surge)
    found = plan_on(grid, start, GuidanceSetpoint(course, 0.6, side), None, PLANNER)
    if found.speed_mps == 0.0:
        return
    time_s, gap_m = swept_gap_m(grid, start, found)
    near = time_s <= PLANNER.horizon_s
    needed = required_clearance_m(time_s, float(gap_m[0]), least)
    assert (gap_m[near] >= np.minimum(needed, gap_m[0] - ESCAPE_TOLERANCE_M)[near] - 0.5 * CELL_M).all()


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_the_advised_side_is_taken_where_both_are_free(side: float) -> None:
    """The advice decides where there is as much room on either side of the bar."""
    bar = (4.0, -0.4, 4.6, 0.4)
    assert plan_on(pool(bar), CRUISING, GuidanceSetpoint(0.0, 0.3, side), None, PLANNER).heading_rad * side > 0.0


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_the_other_side_is_taken_where_only_that_is_free(side: float) -> None:
    """The map decides where a wall stands on the advised side."""
    wall = (2.5, min(-0.5, side * 30.0), 3.5, max(0.5, side * 30.0))
    found = plan_on(pool(wall), BoatState(-1.5, 0.0, 0.0, 0.3), GuidanceSetpoint(0.0, 0.3, side), None, PLANNER)
    assert found.speed_mps == 0.0 or found.heading_rad * side < 0.0


def test_open_water_is_crossed_on_the_desired_course_at_full_speed() -> None:
    """The boat starts at once, because the blind zone beside it counts as water."""
    for start in (RESTING, CRUISING):
        assert plan_on(pool(), start, AHEAD, None, PLANNER) == Plan(0.0, 0.6)
        found = plan_on(pool(), start, GuidanceSetpoint(0.4, 0.6), None, PLANNER)
        assert found.heading_rad == pytest.approx(0.4)


def test_a_boat_turns_the_other_way_round_past_an_obstacle_abeam() -> None:
    """The goal lies abaft the port beam and a quay to port: the boat turns to starboard, away from the quay first.

    Beside the quay it must leave to turn to its course; further off it waits for a candidate on the side of its course.
    """
    for off_m, leaves in ((0.9, True), (1.6, False)):
        quay = (-6.0, off_m, 9.0, off_m + 0.7)
        for course in (1.9, 2.6):
            found = plan_on(
                pool(quay), BoatState(3.0, 0.0, 0.0), GuidanceSetpoint(course, 0.6), Plan(0.0, 0.3), PLANNER
            )
            assert (found.speed_mps > 0.0 and found.heading_rad < -1.0) is leaves


@pytest.mark.parametrize(("half_m", "speed_mps"), [(2.2, 0.6), (1.5, 0.3), (1.2, 0.06), (0.9, 0.06), (0.5, 0.06)])
def test_the_margin_is_relaxed_where_the_whole_one_leaves_no_candidate(half_m: float, speed_mps: float) -> None:
    """The boat goes on slowly; with less than half the margin it pivots and looks for another way."""
    ahead = BoatState(0.0, 0.0, 0.0, 0.5)
    gap = pool((1.8, half_m, 6.0, 4.0), (1.8, -4.0, 6.0, -half_m))
    assert plan_on(gap, ahead, AHEAD, None, PLANNER).speed_mps == speed_mps


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_boat_beside_a_hull_moves_away_before_it_turns_to_its_course(side: float) -> None:
    """A boat with less than its margin does not come nearer with one plan after another: each leads further off."""
    hull = (-6.0, min(side * 0.75, side * 2.5), 6.0, max(side * 0.75, side * 2.5))
    quay = pool((2.5, min(side * 0.75, side * 2.5), 6.0, max(side * 0.75, side * 2.5)), hull)
    start = BoatState(2.0, 0.0, 0.0, 0.4)
    found = plan_on(quay, start, GuidanceSetpoint(side * 1.2, 0.6), None, PLANNER)
    assert found.speed_mps > 0.0
    assert found.heading_rad * side <= 0.0


@settings(max_examples=40, deadline=None)
@given(
    ahead_m=st.floats(2.6, 4.5),
    left_m=st.floats(-0.6, 0.6),
    gone_m=st.floats(0.0, 3.5),
    surge=st.floats(0.0, 0.6),
    course=st.floats(-3.1, 3.1),
)
@pytest.mark.slow
def test_no_plan_leads_over_a_person(ahead_m: float, left_m: float, gone_m: float, surge: float, course: float) -> None:
    """A boat within the room around a swimmer keeps hull and Q6's margin all the same."""
    corners = np.array([[ahead_m, left_m - 0.3, 0.0], [ahead_m, left_m + 0.3, 0.0]])
    (right, low), (left, _) = project(corners, AT_REST, EYE) / [EYE.width_px, EYE.height_px]
    swimmer = Detection(label=Label.PERSON, confidence=0.9, box_xyxy=(left, low - 0.1, right, low))
    grid = build_occupancy_grid(observe_from(detections=(swimmer,)).observations, (0.0, 0.0), START_US, CAMERA, PLANNER)
    assert grid.people.any()
    start = BoatState(min(gone_m, ahead_m - 0.3), 0.0, 0.0, surge)
    found = plan_on(grid, start, GuidanceSetpoint(course, 0.6), None, PLANNER)
    if found.speed_mps > 0.0:
        time_s, gap_m = swept_gap_m(grid._replace(occupied=grid.people), start, found)
        near = time_s <= PLANNER.horizon_s
        assert (gap_m[near] >= min(0.8, gap_m[0]) - CELL_M).all()


def test_without_a_recent_observation_the_boat_stops() -> None:
    """Q2: cells are unknown by default, and unknown is not free."""
    memory = observe_from()
    for observations, age_us in ((ObservationMemory().observations, 0), (memory.observations, 810_000)):
        grid = build_occupancy_grid(observations, (0.0, 0.0), START_US + age_us, CAMERA, PLANNER)
        assert plan_on(grid, RESTING, AHEAD, None, PLANNER).speed_mps == 0.0


def test_a_boat_before_a_wall_pivots() -> None:
    """Thrusters that only push stay off: they would drive the boat on while it turns."""
    fans = load_config(profile="fans").navigator.planner
    for start in (RESTING, CRUISING):
        found = plan_on(pool(bank_m=1.6), start, AHEAD, None, PLANNER)
        assert found.speed_mps == pytest.approx(PIVOT_SPEED_FRACTION * 0.6)
        assert abs(found.heading_rad) > 1.0
        assert plan_on(pool(bank_m=1.6), start, AHEAD, None, fans).speed_mps == 0.0


@pytest.mark.slow
def test_a_pivot_is_no_smaller_than_the_smallest_one_allowed() -> None:
    """A boat that may wait does not creep along in small pivots."""
    for bank_m in np.arange(1.0, 4.0, 0.1).tolist():
        found = plan_on(pool(bank_m=bank_m), RESTING, AHEAD, None, PLANNER)
        assert found.speed_mps in (0.0, 0.3, 0.6) or abs(found.heading_rad) >= MIN_PIVOT_RAD


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_boat_that_would_coast_onto_an_obstacle_steers_past_it(side: float) -> None:
    """No candidate keeps clear of it any more, but coasting straight on would come nearer."""
    low, high = sorted((0.1 * side, 0.4 * side))
    grid, start = pool((1.7, low, 2.0, high)), BoatState(0.9, 0.0, 0.0, 0.6)
    found = plan_on(grid, start, AHEAD, None, PLANNER)
    assert found.speed_mps > 0.0
    assert found.heading_rad * side < -0.3
    time_s, gap_m = swept_gap_m(grid, start, found)
    coast_m = static_distances_m(grid, roll_out_coasting(start, time_s, PLANNER))
    soon = time_s <= PLANNER.horizon_s
    assert gap_m[soon].min() > coast_m[soon].min()


def test_an_obstacle_is_passed_on_the_side_with_more_room() -> None:
    for side in (-1.0, 1.0):
        bar = (4.0, min(-0.3, side * 0.9), 4.6, max(0.3, side * 0.9))
        found = plan_on(pool(bar), CRUISING, AHEAD, None, PLANNER)
        assert found.speed_mps > 0.0
        assert found.heading_rad * side < -0.1


def test_the_side_of_the_previous_plan_is_kept() -> None:
    """The previous plan decides where there is as much room on either side."""
    bar = (4.0, -0.4, 4.6, 0.4)
    for before in (0.35, -0.35):
        found = plan_on(pool(bar), CRUISING, AHEAD, Plan(before, 0.6), PLANNER)
        assert found.heading_rad * before > 0.0


@pytest.mark.parametrize(("half_m", "ahead_m"), [(0.4, 1.2), (0.4, 1.6), (0.6, 1.2)])
def test_a_side_is_kept_while_the_obstacle_seems_to_shift_by_a_cell(half_m: float, ahead_m: float) -> None:
    """A boat that pivots back with every picture goes neither way."""
    plan, sides = None, set()
    for number in range(6):
        shift_m = CELL_M * (number % 2)
        grid = round_about(bar_on_grid((ahead_m, shift_m - half_m, ahead_m + 0.6, shift_m + half_m)))
        plan = plan_on(grid, RESTING, AHEAD, plan, PLANNER)
        assert plan.speed_mps > 0.0
        sides.add(plan.heading_rad > 0.0)
    assert len(sides) == 1


def test_no_cell_within_the_stopping_distance_may_be_unknown() -> None:
    """A boat that needs longer to stop goes slower, or stops: it never outruns what was seen free."""
    near = msgspec.structs.replace(PLANNER, max_range_m=2.6)
    memory = observe_from()
    grid = build_occupancy_grid(memory.observations, (0.0, 0.0), START_US, CAMERA, near)
    speeds = [
        plan_on(grid, RESTING, AHEAD, None, msgspec.structs.replace(near, stop_s=stop_s)).speed_mps
        for stop_s in (2.5, 6.0, 20.0, 40.0)
    ]
    assert speeds == [0.6, 0.3, 0.06, 0.0]
    blind = msgspec.structs.replace(PLANNER, blind_m=0.0)
    grid = build_occupancy_grid(memory.observations, (0.0, 0.0), START_US, CAMERA, blind)
    assert plan_on(grid, RESTING, AHEAD, None, blind).speed_mps == 0.0


def test_an_obstacle_that_left_the_picture_below_is_remembered() -> None:
    """The boat saw a buoy 3 m ahead and drifted up to it, until it was too near to be in the picture."""
    buoy = (3.0, -0.3, 3.5, 0.3)
    memory, at_us, boat = ObservationMemory(), START_US, AT_REST
    for x_m in np.arange(0.0, 1.9, 0.1).tolist():
        boat = BoatPose(x_m, 0.0, 0.0)
        memory, at_us = observe_from(boat, water_edge_of(boat, (buoy,)), at_us + 300_000, memory), at_us + 300_000
    assert max(water_edge_of(boat, (buoy,))) < 0.7  # it has left the picture
    for _ in range(5):
        at_us += 300_000
        memory = observe_from(boat, at_us=at_us, memory=memory)
    grid = build_occupancy_grid(memory.observations, (boat.x_m, 0.0), at_us, CAMERA, PLANNER)
    found = plan_on(grid, BoatState(boat.x_m, 0.0, 0.0), AHEAD, None, PLANNER)
    time_s, gap_m = swept_gap_m(grid, BoatState(boat.x_m, 0.0, 0.0), found)
    assert found.speed_mps == 0.0 or gap_m[time_s <= 3.0].min() > 0.5
    forgetful = build_occupancy_grid(memory.observations, (boat.x_m, 0.0), at_us, CAMERA, PAPER)
    assert not forgetful.occupied[49:51, 50:58].any()


@pytest.mark.parametrize("course", [0.0, 0.8, -0.8, 2.0])
def test_a_boat_inside_an_obstacle_goes_no_deeper(course: float) -> None:
    """Full ahead through the cells that occupy the boat is no escape, though no cell on the way is further inside."""
    grid = round_about(bar_on_grid((-0.2, -2.0, 2.4, 2.0)))  # the boat is 0.2 m inside the western side
    found = plan_on(grid, RESTING, GuidanceSetpoint(course, 0.6), None, PLANNER)
    if found.speed_mps > 0.0:
        assert clearance_along_m(grid, RESTING, found).min() >= -0.1 - 0.5 * CELL_M - ESCAPE_TOLERANCE_M
        assert abs(found.heading_rad) > 1.5


@pytest.mark.parametrize("gap_m", [0.3, 0.4, 0.5])
def test_a_boat_with_its_bow_aslant_to_an_obstacle_pivots_away(gap_m: float) -> None:
    """A pivot escapes, though the boat is no further off within the horizon."""
    row, column = np.indices((GRID_CELLS, GRID_CELLS))
    behind = column - 50 - np.rint(0.5 * (row - 50))
    cells = (behind >= 0) & (behind < 10)
    start = BoatState(-gap_m, 0.0, 0.0)
    stopped = Plan(0.0, 0.0)
    found = plan_on(round_about(cells), start, GuidanceSetpoint(1.9, 0.3), stopped, PLANNER)
    assert found.speed_mps == pytest.approx(PIVOT_SPEED_FRACTION * 0.3)
    assert clearance_along_m(round_about(cells), start, found).min() >= gap_m - ESCAPE_TOLERANCE_M - 0.5 * CELL_M
    cells[:, :48] = cells[:48] = cells[52:] = True  # in a corner no pivot leads out, and it stops
    assert plan_on(round_about(cells), start, GuidanceSetpoint(1.9, 0.3), stopped, PLANNER).speed_mps == 0.0


@pytest.mark.parametrize("course", [1.2, 2.0, 2.8])
@pytest.mark.slow
def test_a_stopped_boat_facing_away_pivots_to_its_course_before_it_moves(course: float) -> None:
    """An obstacle may have come up on the side that the camera has not seen since the boat stopped."""
    row, column = np.indices((GRID_CELLS, GRID_CELLS))
    cells = np.hypot(column - 49.5, row - 57.5) < 1.6  # abeam, 1.3 m off
    setpoint = GuidanceSetpoint(course, 0.6)
    pivot = Plan(float(sample_candidates(RESTING, setpoint, PLANNER)[0][0]), PIVOT_SPEED_FRACTION * 0.6)
    for before in (None, Plan(0.0, 0.0), Plan(course, PIVOT_SPEED_FRACTION * 0.6)):
        assert plan_on(round_about(cells), RESTING, setpoint, before, PLANNER) == pivot
    assert (
        plan_on(round_about(cells), RESTING, setpoint, Plan(-2.0, PIVOT_SPEED_FRACTION * 0.6), PLANNER) != pivot
    )  # it has already turned that way
    assert plan_on(round_about(cells), CRUISING, setpoint, Plan(0.0, 0.6), PLANNER) != pivot
    near = np.hypot(column - 49.5, row - 54.5) < 1.6
    assert plan_on(round_about(near), RESTING, setpoint, None, PLANNER) != pivot  # the hull has no room to pivot


@pytest.mark.parametrize("surge", [0.0, 0.6])
def test_near_an_obstacle_no_candidate_is_feasible_at_full_speed(surge: float) -> None:
    """Beside a wall 0.5 m off, less than hull and Q6's margin, it goes at half the speed; 2 m off at the whole."""
    speeds = []
    for wall_m in (0.4, 2.0):
        grid = round_about(bar_on_grid((-10.0, wall_m, 10.0, 2.0 + wall_m)))
        speeds.append(plan_on(grid, BoatState(0.0, 0.0, 0.0, surge), AHEAD, None, PLANNER).speed_mps)
    assert speeds == [0.3, 0.6]


def test_plans_are_reproduced_bit_by_bit() -> None:
    """The same observations give the same plan to the last bit, whatever was computed in between."""
    bar = (4.0, -0.4, 4.6, 0.4)
    first = msgspec.json.encode(plan_on(pool(bar), CRUISING, GuidanceSetpoint(0.123, 0.6), None, PLANNER))
    plan_on(pool(), RESTING, GuidanceSetpoint(-1.0, 0.3, 1.0), None, PLANNER)
    assert msgspec.json.encode(plan_on(pool(bar), CRUISING, GuidanceSetpoint(0.123, 0.6), None, PLANNER)) == first
