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
from paani_services.navigator.avoidance.clearance import clearance_field_m, required_clearance_m
from paani_services.navigator.avoidance.planner import ESCAPE_TOLERANCE_M, MIN_PIVOT_RAD, Plan, plan_motion
from paani_services.navigator.avoidance.rollout import (
    PIVOT_SPEED_FRACTION,
    BoatState,
    GuidanceSetpoint,
    Trajectories,
    roll_out,
    roll_out_coasting,
    sample_candidates,
)
from paani_services.navigator.mapping.distance_field import distance_field_m
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
    standing_gaps_m,
    water_edge_of,
)

PAPER = load_config(profile="paper").navigator.planner
AHEAD = GuidanceSetpoint(0.0, 0.6)
RESTING, CRUISING = BoatState(0.0, 0.0, 0.0), BoatState(0.0, 0.0, 0.0, 0.6)


def pool(*bars: Bar, bank_m: float = 500.0) -> OccupancyGrid:
    """The grid of a boat at the origin that has just looked along x."""
    memory = observe_from(edge=water_edge_of(AT_REST, bars, bank_m))
    return build_occupancy_grid(memory.observations, (0.0, 0.0), START_US, CAMERA, PLANNER)


def swept_gap_m(grid: OccupancyGrid, start: BoatState, found: Plan) -> tuple[np.ndarray, np.ndarray]:
    """Times and distances from the middle of the nearest occupied cell, all the way that the plan leads."""
    trajectories = planned_trajectory(start, found)
    return trajectories.time_s, standing_gaps_m(grid, trajectories)


def planned_trajectory(start: BoatState, found: Plan) -> Trajectories:
    """Where the plan leads."""
    off = (found.heading_rad - start.yaw_rad + math.pi) % (2.0 * math.pi) - math.pi
    return roll_out(start, np.array([off]), np.array([found.speed_mps]), PLANNER)


def round_about(occupied: np.ndarray) -> OccupancyGrid:
    """A grid round the origin where all that is not occupied is free."""
    none = np.zeros_like(occupied)
    return OccupancyGrid(
        -10.0, -10.0, occupied, occluded=none, free=~occupied, blind_zone=none, people=none, reachable_unseen=none
    )


def clearance_along_m(grid: OccupancyGrid, start: BoatState, found: Plan) -> np.ndarray:
    """From where the plan leads within the horizon to what is occupied, negative within it."""
    trajectories = planned_trajectory(start, found)
    column, row = (trajectories.x_m[:, 0] - grid.west_m) / CELL_M, (trajectories.y_m[:, 0] - grid.south_m) / CELL_M
    near = trajectories.time_s <= PLANNER.horizon_s
    return np.asarray(clearance_field_m(grid, PLANNER)[row.astype(int), column.astype(int)][near])


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
def test_q5_speed_yaw_rate_and_acceleration(surge: float, rate: float, offset: float, speed: float) -> None:
    """Q5: no way is faster than 0.4 m/s, turns faster than 0.35 rad/s or speeds up by more than 0.2 m/s2."""
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
    """Q6: 0.55 m hull, 0.25 m margin, 0.15 m/s of drift; where it is tighter already, no nearer."""
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
def test_no_way_leads_into_what_is_occupied(
    bars: list[tuple[float, float, float, float]], bank_m: float, course: float, surge: float, side: float
) -> None:
    """Q4, Q6: along the plan the footprint is clear of every occupied cell for 3 s; half a cell for looking it up.

    The least footprint is the hull and half a cell. A way out comes hardly nearer to what the boat lies beside.
    """
    least = msgspec.structs.replace(PLANNER, margin_m=0.5 * CELL_M, drift_mps=0.0)
    grid = pool(*((x, y, x + deep, y + wide) for x, y, deep, wide in bars), bank_m=bank_m)
    start = BoatState(0.0, 0.0, 0.0, surge)
    found = plan_motion(grid, start, GuidanceSetpoint(course, 0.6, side), None, PLANNER)
    if found.speed_mps == 0.0:
        return
    time_s, gap_m = swept_gap_m(grid, start, found)
    near = time_s <= PLANNER.horizon_s
    needed = required_clearance_m(time_s, float(gap_m[0]), least)
    assert (gap_m[near] >= np.minimum(needed, gap_m[0] - ESCAPE_TOLERANCE_M)[near] - 0.5 * CELL_M).all()


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_the_advised_side_is_taken_where_both_are_free(side: float) -> None:
    """As much room on either side of the bar: the advice decides."""
    bar = (4.0, -0.4, 4.6, 0.4)
    assert plan_motion(pool(bar), CRUISING, GuidanceSetpoint(0.0, 0.3, side), None, PLANNER).heading_rad * side > 0.0


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_the_other_side_is_taken_where_only_that_is_free(side: float) -> None:
    """A wall on the side that is advised: what is seen free decides, and never what is occupied."""
    wall = (2.5, min(-0.5, side * 30.0), 3.5, max(0.5, side * 30.0))
    found = plan_motion(pool(wall), BoatState(-1.5, 0.0, 0.0, 0.3), GuidanceSetpoint(0.0, 0.3, side), None, PLANNER)
    assert found.speed_mps == 0.0 or found.heading_rad * side < 0.0


def test_open_water_is_crossed_on_the_wanted_course_at_full_speed() -> None:
    """At the start too: what no picture shows beside the boat is the operator's word."""
    for start in (RESTING, CRUISING):
        assert plan_motion(pool(), start, AHEAD, None, PLANNER) == Plan(0.0, 0.6)
        found = plan_motion(pool(), start, GuidanceSetpoint(0.4, 0.6), None, PLANNER)
        assert found.heading_rad == pytest.approx(0.4)


def test_a_way_is_found_round_what_lies_abeam_of_the_goal() -> None:
    """The goal lies abaft the port beam and a quay to port: the boat turns to starboard, away from it first.

    It need not lie beside something to turn to its course; further off it waits for a way on the side of its course.
    """
    for off_m, leaves in ((0.9, True), (1.6, False)):
        quay = (-6.0, off_m, 9.0, off_m + 0.7)
        for course in (1.9, 2.6):
            found = plan_motion(
                pool(quay), BoatState(3.0, 0.0, 0.0), GuidanceSetpoint(course, 0.6), Plan(0.0, 0.3), PLANNER
            )
            assert (found.speed_mps > 0.0 and found.heading_rad < -1.0) is leaves


@pytest.mark.parametrize(("span_deg", "count"), [(120.0, 25), (180.0, 36)])
def test_every_heading_round_the_course_is_tried_once(span_deg: float, count: int) -> None:
    """Those on the far side of a course abaft the beam are turned to the other way round."""
    config = msgspec.structs.replace(PLANNER, span_deg=span_deg)
    for course in (0.0, 1.0, -3.0, math.pi):
        offsets, _ = sample_candidates(RESTING, GuidanceSetpoint(course, 0.6), config)
        assert len(offsets[::3]) == len(set(np.round(offsets % (2.0 * math.pi), 6).tolist())) == count
        off = np.abs((offsets - course + math.pi) % (2.0 * math.pi) - math.pi)
        assert off.max() <= math.radians(span_deg) + 1e-9
        assert np.abs(offsets).max() <= math.pi


@pytest.mark.parametrize(("half_m", "speed_mps"), [(2.2, 0.6), (1.5, 0.3), (1.2, 0.06), (0.9, 0.06), (0.5, 0.06)])
def test_less_margin_is_kept_where_the_whole_one_leaves_nothing(half_m: float, speed_mps: float) -> None:
    """A boat under way goes on, slowly; beyond half the margin it turns on the spot and looks round for another way."""
    ahead = BoatState(0.0, 0.0, 0.0, 0.5)
    gap = pool((1.8, half_m, 6.0, 4.0), (1.8, -4.0, 6.0, -half_m))
    assert plan_motion(gap, ahead, AHEAD, None, PLANNER).speed_mps == speed_mps


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_boat_beside_a_hull_opens_away_before_it_turns_to_its_course(side: float) -> None:
    """Nearer than the margin, no plan after another comes half a cell nearer: each leads further off."""
    hull = (-6.0, min(side * 0.75, side * 2.5), 6.0, max(side * 0.75, side * 2.5))
    quay = pool((2.5, min(side * 0.75, side * 2.5), 6.0, max(side * 0.75, side * 2.5)), hull)
    start = BoatState(2.0, 0.0, 0.0, 0.4)
    found = plan_motion(quay, start, GuidanceSetpoint(side * 1.2, 0.6), None, PLANNER)
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
def test_nothing_leads_over_a_person(ahead_m: float, left_m: float, gone_m: float, surge: float, course: float) -> None:
    """Within the room round a swimmer every way seems to come no nearer: hull and Q6's margin are kept all the same."""
    corners = np.array([[ahead_m, left_m - 0.3, 0.0], [ahead_m, left_m + 0.3, 0.0]])
    (right, low), (left, _) = project(corners, AT_REST, EYE) / [EYE.width_px, EYE.height_px]
    swimmer = Detection(label=Label.PERSON, confidence=0.9, box_xyxy=(left, low - 0.1, right, low))
    grid = build_occupancy_grid(observe_from(detections=(swimmer,)).observations, (0.0, 0.0), START_US, CAMERA, PLANNER)
    assert grid.people.any()
    start = BoatState(min(gone_m, ahead_m - 0.3), 0.0, 0.0, surge)
    found = plan_motion(grid, start, GuidanceSetpoint(course, 0.6), None, PLANNER)
    if found.speed_mps > 0.0:
        time_s, gap_m = swept_gap_m(grid._replace(occupied=grid.people), start, found)
        near = time_s <= PLANNER.horizon_s
        assert (gap_m[near] >= min(0.8, gap_m[0]) - CELL_M).all()


def test_a_boat_is_carried_sideways_while_it_turns() -> None:
    """The sway it has now, in the map, all the way."""
    still, carried = (
        roll_out(BoatState(0.0, 0.0, 0.3, 0.5, 0.0, sway), np.array([0.4]), np.array([0.6]), PLANNER)
        for sway in (0.0, 0.2)
    )
    assert carried.x_m - still.x_m == pytest.approx(-0.2 * math.sin(0.3) * still.time_s[:, None])
    assert carried.y_m - still.y_m == pytest.approx(0.2 * math.cos(0.3) * still.time_s[:, None])
    assert (carried.travelled_m == still.travelled_m).all()


def test_nothing_seen_or_nothing_lately_is_nowhere_to_go() -> None:
    """Q2: unknown by default, and unknown is not free."""
    memory = observe_from()
    for observations, age_us in ((ObservationMemory().observations, 0), (memory.observations, 810_000)):
        grid = build_occupancy_grid(observations, (0.0, 0.0), START_US + age_us, CAMERA, PLANNER)
        assert plan_motion(grid, RESTING, AHEAD, None, PLANNER).speed_mps == 0.0


def test_a_boat_before_a_wall_turns_on_the_spot() -> None:
    """Fans that only push are off: they would drive it on while it turns."""
    fans = load_config(profile="fans").navigator.planner
    for start in (RESTING, CRUISING):
        found = plan_motion(pool(bank_m=1.6), start, AHEAD, None, PLANNER)
        assert found.speed_mps == pytest.approx(PIVOT_SPEED_FRACTION * 0.6)
        assert abs(found.heading_rad) > 1.0
        assert plan_motion(pool(bank_m=1.6), start, AHEAD, None, fans).speed_mps == 0.0


def test_what_turns_on_the_spot_turns_by_more_than_a_little() -> None:
    """A boat that may wait does not creep along."""
    for bank_m in np.arange(1.0, 4.0, 0.1).tolist():
        found = plan_motion(pool(bank_m=bank_m), RESTING, AHEAD, None, PLANNER)
        assert found.speed_mps in (0.0, 0.3, 0.6) or abs(found.heading_rad) >= MIN_PIVOT_RAD


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_boat_that_would_coast_onto_something_steers_past_it(side: float) -> None:
    """No way keeps off it any more, but with its fans off the boat keeps off less: it runs straight on."""
    low, high = sorted((0.1 * side, 0.4 * side))
    grid, start = pool((1.7, low, 2.0, high)), BoatState(0.9, 0.0, 0.0, 0.6)
    found = plan_motion(grid, start, AHEAD, None, PLANNER)
    assert found.speed_mps > 0.0
    assert found.heading_rad * side < -0.3
    time_s, gap_m = swept_gap_m(grid, start, found)
    coast_m = standing_gaps_m(grid, roll_out_coasting(start, time_s, PLANNER))
    soon = time_s <= PLANNER.horizon_s
    assert gap_m[soon].min() > coast_m[soon].min()


def test_a_boat_coasts_as_far_as_its_drag_lets_it() -> None:
    """0.1 m/s of 0.6 may be wind and goes on; the drag of K5 takes the rest in 0.78 m, sideways it stays."""
    time_s = np.linspace(0.0, 20.0, 201)
    way = roll_out_coasting(BoatState(1.0, 2.0, math.pi / 2.0, 0.6, 0.0, 0.1), time_s, PLANNER)
    assert way.y_m[:, 0] - 2.0 == pytest.approx(way.travelled_m[:, 0], abs=1e-6)
    assert way.x_m[:, 0] == pytest.approx(1.0 - 0.1 * time_s, abs=1e-6)
    assert way.travelled_m[-1, 0] == pytest.approx(2.0 + 12.4 / 20.0 * math.log(1.0 + 20.0 * 0.5 / 4.0), abs=0.05)
    assert roll_out_coasting(BoatState(0.0, 0.0, 0.0, 0.06), time_s, PLANNER).travelled_m[-1, 0] == pytest.approx(
        0.06 * 20.0
    )
    assert roll_out_coasting(RESTING, time_s, PLANNER).travelled_m.max() == 0.0


def test_what_stands_in_the_way_is_passed_on_the_side_with_more_room() -> None:
    for side in (-1.0, 1.0):
        bar = (4.0, min(-0.3, side * 0.9), 4.6, max(0.3, side * 0.9))
        found = plan_motion(pool(bar), CRUISING, AHEAD, None, PLANNER)
        assert found.speed_mps > 0.0
        assert found.heading_rad * side < -0.1


def test_a_side_once_chosen_is_kept() -> None:
    """As much room on either side: the plan before decides."""
    bar = (4.0, -0.4, 4.6, 0.4)
    for before in (0.35, -0.35):
        found = plan_motion(pool(bar), CRUISING, AHEAD, Plan(before, 0.6), PLANNER)
        assert found.heading_rad * before > 0.0


def test_nothing_within_the_way_to_stop_may_be_unknown() -> None:
    """A boat that needs longer to stop goes slower, or not at all: it never outruns what was seen free."""
    near = msgspec.structs.replace(PLANNER, max_range_m=2.6)
    memory = observe_from()
    grid = build_occupancy_grid(memory.observations, (0.0, 0.0), START_US, CAMERA, near)
    speeds = [
        plan_motion(grid, RESTING, AHEAD, None, msgspec.structs.replace(near, stop_s=stop_s)).speed_mps
        for stop_s in (2.5, 6.0, 20.0, 40.0)
    ]
    assert speeds == [0.6, 0.3, 0.06, 0.0]
    blind = msgspec.structs.replace(PLANNER, blind_m=0.0)
    grid = build_occupancy_grid(memory.observations, (0.0, 0.0), START_US, CAMERA, blind)
    assert plan_motion(grid, RESTING, AHEAD, None, blind).speed_mps == 0.0


def test_what_went_out_of_sight_below_the_picture_is_still_there() -> None:
    """Seen 3 m ahead, then too near to be seen: the boat that drifted up to it does not run over it."""
    buoy = (3.0, -0.3, 3.5, 0.3)
    memory, at_us, boat = ObservationMemory(), START_US, AT_REST
    for x_m in np.arange(0.0, 1.9, 0.1).tolist():
        boat = BoatPose(x_m, 0.0, 0.0)
        memory, at_us = observe_from(boat, water_edge_of(boat, (buoy,)), at_us + 300_000, memory), at_us + 300_000
    assert max(water_edge_of(boat, (buoy,))) < 0.7  # it is not in the picture any more
    for _ in range(5):
        at_us += 300_000
        memory = observe_from(boat, at_us=at_us, memory=memory)
    grid = build_occupancy_grid(memory.observations, (boat.x_m, 0.0), at_us, CAMERA, PLANNER)
    found = plan_motion(grid, BoatState(boat.x_m, 0.0, 0.0), AHEAD, None, PLANNER)
    time_s, gap_m = swept_gap_m(grid, BoatState(boat.x_m, 0.0, 0.0), found)
    assert found.speed_mps == 0.0 or gap_m[time_s <= 3.0].min() > 0.5
    forgetful = build_occupancy_grid(memory.observations, (boat.x_m, 0.0), at_us, CAMERA, PAPER)
    assert not forgetful.occupied[49:51, 50:58].any()


@pytest.mark.parametrize("course", [0.0, 0.8, -0.8, 2.0])
def test_a_boat_within_what_is_occupied_goes_no_deeper(course: float) -> None:
    """What came alongside covers the boat: full ahead through it is no way out, though no cell there is further off."""
    cells = np.zeros((GRID_CELLS, GRID_CELLS), np.bool_)
    cells[40:60, 49:62] = True  # the boat lies 0.2 m inside its western side
    grid = round_about(cells)
    found = plan_motion(grid, RESTING, GuidanceSetpoint(course, 0.6), None, PLANNER)
    if found.speed_mps > 0.0:
        assert clearance_along_m(grid, RESTING, found).min() >= -0.1 - 0.5 * CELL_M - ESCAPE_TOLERANCE_M
        assert abs(found.heading_rad) > 1.5


@pytest.mark.parametrize("gap_m", [0.3, 0.4, 0.5])
def test_a_boat_with_its_bow_aslant_to_something_turns_away_on_the_spot(gap_m: float) -> None:
    """That leads it out, though it is no further off within the horizon: it lay there until it was drifted onto."""
    row, column = np.indices((GRID_CELLS, GRID_CELLS))
    behind = column - 50 - np.rint(0.5 * (row - 50))
    cells = (behind >= 0) & (behind < 10)
    start = BoatState(-gap_m, 0.0, 0.0)
    stopped = Plan(0.0, 0.0)
    found = plan_motion(round_about(cells), start, GuidanceSetpoint(1.9, 0.3), stopped, PLANNER)
    assert found.speed_mps == pytest.approx(PIVOT_SPEED_FRACTION * 0.3)
    assert clearance_along_m(round_about(cells), start, found).min() >= gap_m - ESCAPE_TOLERANCE_M - 0.5 * CELL_M
    cells[:, :48] = cells[:48] = cells[52:] = True  # and in a corner that leads nowhere it lies still
    assert plan_motion(round_about(cells), start, GuidanceSetpoint(1.9, 0.3), stopped, PLANNER).speed_mps == 0.0


@pytest.mark.parametrize("course", [1.2, 2.0, 2.8])
def test_a_boat_that_lay_still_turns_to_what_it_does_not_see_before_it_goes(course: float) -> None:
    """Something may have come up beside it: one went ahead, round, and into a hull that it had not seen for 30 s."""
    row, column = np.indices((GRID_CELLS, GRID_CELLS))
    cells = np.hypot(column - 49.5, row - 57.5) < 1.6  # abeam, 1.3 m off
    wish = GuidanceSetpoint(course, 0.6)
    about = Plan(float(sample_candidates(RESTING, wish, PLANNER)[0][0]), PIVOT_SPEED_FRACTION * 0.6)
    for before in (None, Plan(0.0, 0.0), Plan(course, PIVOT_SPEED_FRACTION * 0.6)):
        assert plan_motion(round_about(cells), RESTING, wish, before, PLANNER) == about
    assert (
        plan_motion(round_about(cells), RESTING, wish, Plan(-2.0, PIVOT_SPEED_FRACTION * 0.6), PLANNER) != about
    )  # it has looked there
    assert plan_motion(round_about(cells), CRUISING, wish, Plan(0.0, 0.6), PLANNER) != about
    near = np.hypot(column - 49.5, row - 54.5) < 1.6
    assert plan_motion(round_about(near), RESTING, wish, None, PLANNER) != about  # there is no room for it


@pytest.mark.parametrize("surge", [0.0, 0.6])
def test_near_anything_no_way_is_taken_at_full_speed(surge: float) -> None:
    """Beside a wall 0.5 m off, less than hull and Q6's margin, it goes at half the speed; at 2 m at the whole."""
    speeds = []
    for wall_m in (0.4, 2.0):
        cells = np.zeros((GRID_CELLS, GRID_CELLS), np.bool_)
        cells[50 + round(wall_m / CELL_M) : 60, :] = True
        speeds.append(plan_motion(round_about(cells), BoatState(0.0, 0.0, 0.0, surge), AHEAD, None, PLANNER).speed_mps)
    assert speeds == [0.3, 0.6]


@settings(max_examples=10, deadline=None)
@given(cells=st.lists(st.tuples(st.integers(0, 99), st.integers(0, 99)), min_size=1, max_size=12))
def test_distances_are_those_to_the_nearest_cell(cells: list[tuple[int, int]]) -> None:
    mask = np.zeros((GRID_CELLS, GRID_CELLS), np.bool_)
    for row, column in cells:
        mask[row, column] = True
    rows, columns = np.indices(mask.shape)
    exact = np.min([np.hypot(rows - row, columns - column) for row, column in cells], axis=0) * CELL_M
    assert distance_field_m(mask) == pytest.approx(np.minimum(exact, 4.0))


def test_plans_repeat_bit_by_bit() -> None:
    """The same sights give the same plan to the last bit, whatever was computed in between."""
    bar = (4.0, -0.4, 4.6, 0.4)
    first = msgspec.json.encode(plan_motion(pool(bar), CRUISING, GuidanceSetpoint(0.123, 0.6), None, PLANNER))
    plan_motion(pool(), RESTING, GuidanceSetpoint(-1.0, 0.3, 1.0), None, PLANNER)
    assert msgspec.json.encode(plan_motion(pool(bar), CRUISING, GuidanceSetpoint(0.123, 0.6), None, PLANNER)) == first
