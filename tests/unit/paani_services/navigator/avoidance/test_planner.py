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
from paani_services.navigator.avoidance.clearance import clearance_m, footprint_m
from paani_services.navigator.avoidance.planner import LOSE_M, ON_THE_SPOT_RAD, Plan, plan
from paani_services.navigator.avoidance.rollout import PARTS, Start, Ways, Wish, candidates, coasting, roll_out
from paani_services.navigator.mapping.distance_field import distance_m
from paani_services.navigator.mapping.observation import Memory
from paani_services.navigator.mapping.observed_cells import CELL_M
from paani_services.navigator.mapping.occupancy_grid import CELLS, Grid, lay
from paani_sim.eye.camera import BoatPose, project
from tests.synthetic_water import AT_REST, CAMERA, EYE, PLANNER, START_US, Bar, edge_of, seen, standing_gaps_m

PAPER = load_config(profile="paper").navigator.planner
AHEAD = Wish(0.0, 0.6)
RESTING, CRUISING = Start(0.0, 0.0, 0.0), Start(0.0, 0.0, 0.0, 0.6)


def pool(*bars: Bar, bank_m: float = 500.0) -> Grid:
    """The grid of a boat at the origin that has just looked along x."""
    memory = seen(edge=edge_of(AT_REST, bars, bank_m))
    return lay(memory.sights, (0.0, 0.0), START_US, CAMERA, PLANNER)


def swept_gap_m(grid: Grid, start: Start, found: Plan) -> tuple[np.ndarray, np.ndarray]:
    """Times and distances from the middle of the nearest occupied cell, all the way that the plan leads."""
    ways = led(start, found)
    return ways.at_s, standing_gaps_m(grid, ways)


def led(start: Start, found: Plan) -> Ways:
    """Where the plan leads."""
    off = (found.heading_rad - start.yaw_rad + math.pi) % (2.0 * math.pi) - math.pi
    return roll_out(start, np.array([off]), np.array([found.speed_mps]), PLANNER)


def round_about(occupied: np.ndarray) -> Grid:
    """A grid round the origin where all that is not occupied is free."""
    none = np.zeros_like(occupied)
    return Grid(-10.0, -10.0, occupied, hidden=none, free=~occupied, beside=none, people=none, strayed=none)


def clearance_along_m(grid: Grid, start: Start, found: Plan) -> np.ndarray:
    """From where the plan leads within the horizon to what is occupied, negative within it."""
    ways = led(start, found)
    column, row = (ways.x_m[:, 0] - grid.west_m) / CELL_M, (ways.y_m[:, 0] - grid.south_m) / CELL_M
    near = ways.at_s <= PLANNER.horizon_s
    return np.asarray(clearance_m(grid, PLANNER)[row.astype(int), column.astype(int)][near])


def test_q4_three_seconds_in_steps_of_0_2() -> None:
    """Q4: the swept footprint's horizon and step, in both profiles."""
    for config in (PAPER, PLANNER):
        ways = roll_out(RESTING, np.zeros(1), np.array([0.4]), config)
        near = ways.at_s[ways.at_s <= 3.0 + 1e-9]
        assert near == pytest.approx(np.arange(16) * 0.2)
    assert roll_out(RESTING, np.zeros(1), np.array([0.4]), PAPER).at_s[-1] == pytest.approx(3.0)


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
    start = Start(0.0, 0.0, 0.0, surge, rate)
    ways = roll_out(start, np.array([offset]), np.array([speed]), PAPER)
    step_s = np.diff(ways.at_s)
    speeds = np.concatenate([[surge], np.diff(ways.way_m[:, 0]) / step_s])
    assert speeds.max() <= 0.4 + 1e-9
    assert np.abs(np.diff(speeds)).max() <= 0.2 * 0.2 + 1e-9
    headings = np.unwrap(np.arctan2(np.diff(ways.y_m[:, 0]), np.diff(ways.x_m[:, 0])))
    moving = np.diff(ways.way_m[:, 0]) > 1e-6
    turns = np.abs(np.diff(headings)) / step_s[1:]
    assert turns[moving[1:] & moving[:-1]].max(initial=0.0) <= 0.35 + 1e-6
    assert candidates(start, Wish(0.3, 5.0), PAPER)[1].max() == 0.4


def test_q6_hull_margin_and_drift() -> None:
    """Q6: 0.55 m hull, 0.25 m margin, 0.15 m/s of drift; where it is tighter already, no nearer."""
    at_s = np.array([0.0, 1.0, 2.0, 3.0])
    for config, margin_m in ((PAPER, 0.25), (PLANNER, 0.7)):
        assert footprint_m(at_s, 2.0, config) == pytest.approx(0.55 + margin_m + 0.15 * at_s)
        assert footprint_m(at_s, 0.7, config) == pytest.approx([0.6, 0.6, 0.6, 0.6])
        assert footprint_m(at_s, 0.3, config) == pytest.approx([0.2, 0.2, 0.2, 0.2])


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
    start = Start(0.0, 0.0, 0.0, surge)
    found = plan(grid, start, Wish(course, 0.6, side), None, PLANNER)
    if found.speed_mps == 0.0:
        return
    at_s, gap_m = swept_gap_m(grid, start, found)
    near = at_s <= PLANNER.horizon_s
    needed = footprint_m(at_s, float(gap_m[0]), least)
    assert (gap_m[near] >= np.minimum(needed, gap_m[0] - LOSE_M)[near] - 0.5 * CELL_M).all()


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_the_advised_side_is_taken_where_both_are_free(side: float) -> None:
    """As much room on either side of the bar: the advice decides."""
    bar = (4.0, -0.4, 4.6, 0.4)
    assert plan(pool(bar), CRUISING, Wish(0.0, 0.3, side), None, PLANNER).heading_rad * side > 0.0


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_the_other_side_is_taken_where_only_that_is_free(side: float) -> None:
    """A wall on the side that is advised: what is seen free decides, and never what is occupied."""
    wall = (2.5, min(-0.5, side * 30.0), 3.5, max(0.5, side * 30.0))
    found = plan(pool(wall), Start(-1.5, 0.0, 0.0, 0.3), Wish(0.0, 0.3, side), None, PLANNER)
    assert found.speed_mps == 0.0 or found.heading_rad * side < 0.0


def test_open_water_is_crossed_on_the_wanted_course_at_full_speed() -> None:
    """At the start too: what no picture shows beside the boat is the operator's word."""
    for start in (RESTING, CRUISING):
        assert plan(pool(), start, AHEAD, None, PLANNER) == Plan(0.0, 0.6)
        found = plan(pool(), start, Wish(0.4, 0.6), None, PLANNER)
        assert found.heading_rad == pytest.approx(0.4)


def test_a_way_is_found_round_what_lies_abeam_of_the_goal() -> None:
    """The goal lies abaft the port beam and a quay to port: the boat turns to starboard, away from it first.

    It need not lie beside something to turn to its course; further off it waits for a way on the side of its course.
    """
    for off_m, leaves in ((0.9, True), (1.6, False)):
        quay = (-6.0, off_m, 9.0, off_m + 0.7)
        for course in (1.9, 2.6):
            found = plan(pool(quay), Start(3.0, 0.0, 0.0), Wish(course, 0.6), Plan(0.0, 0.3), PLANNER)
            assert (found.speed_mps > 0.0 and found.heading_rad < -1.0) is leaves


@pytest.mark.parametrize(("span_deg", "count"), [(120.0, 25), (180.0, 36)])
def test_every_heading_round_the_course_is_tried_once(span_deg: float, count: int) -> None:
    """Those on the far side of a course abaft the beam are turned to the other way round."""
    config = msgspec.structs.replace(PLANNER, span_deg=span_deg)
    for course in (0.0, 1.0, -3.0, math.pi):
        offsets, _ = candidates(RESTING, Wish(course, 0.6), config)
        assert len(offsets[::3]) == len(set(np.round(offsets % (2.0 * math.pi), 6).tolist())) == count
        off = np.abs((offsets - course + math.pi) % (2.0 * math.pi) - math.pi)
        assert off.max() <= math.radians(span_deg) + 1e-9
        assert np.abs(offsets).max() <= math.pi


@pytest.mark.parametrize(("half_m", "speed_mps"), [(2.2, 0.6), (1.5, 0.3), (1.2, 0.06), (0.9, 0.06), (0.5, 0.06)])
def test_less_margin_is_kept_where_the_whole_one_leaves_nothing(half_m: float, speed_mps: float) -> None:
    """A boat under way goes on, slowly; beyond half the margin it turns on the spot and looks round for another way."""
    ahead = Start(0.0, 0.0, 0.0, 0.5)
    gap = pool((1.8, half_m, 6.0, 4.0), (1.8, -4.0, 6.0, -half_m))
    assert plan(gap, ahead, AHEAD, None, PLANNER).speed_mps == speed_mps


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_boat_beside_a_hull_opens_away_before_it_turns_to_its_course(side: float) -> None:
    """Nearer than the margin, no plan after another comes half a cell nearer: each leads further off."""
    hull = (-6.0, min(side * 0.75, side * 2.5), 6.0, max(side * 0.75, side * 2.5))
    quay = pool((2.5, min(side * 0.75, side * 2.5), 6.0, max(side * 0.75, side * 2.5)), hull)
    start = Start(2.0, 0.0, 0.0, 0.4)
    found = plan(quay, start, Wish(side * 1.2, 0.6), None, PLANNER)
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
    grid = lay(seen(detections=(swimmer,)).sights, (0.0, 0.0), START_US, CAMERA, PLANNER)
    assert grid.people.any()
    start = Start(min(gone_m, ahead_m - 0.3), 0.0, 0.0, surge)
    found = plan(grid, start, Wish(course, 0.6), None, PLANNER)
    if found.speed_mps > 0.0:
        at_s, gap_m = swept_gap_m(grid._replace(occupied=grid.people), start, found)
        near = at_s <= PLANNER.horizon_s
        assert (gap_m[near] >= min(0.8, gap_m[0]) - CELL_M).all()


def test_a_boat_is_carried_sideways_while_it_turns() -> None:
    """The sway it has now, in the map, all the way."""
    still, carried = (
        roll_out(Start(0.0, 0.0, 0.3, 0.5, 0.0, sway), np.array([0.4]), np.array([0.6]), PLANNER) for sway in (0.0, 0.2)
    )
    assert carried.x_m - still.x_m == pytest.approx(-0.2 * math.sin(0.3) * still.at_s[:, None])
    assert carried.y_m - still.y_m == pytest.approx(0.2 * math.cos(0.3) * still.at_s[:, None])
    assert (carried.way_m == still.way_m).all()


def test_nothing_seen_or_nothing_lately_is_nowhere_to_go() -> None:
    """Q2: unknown by default, and unknown is not free."""
    memory = seen()
    for sights, age_us in ((Memory().sights, 0), (memory.sights, 810_000)):
        grid = lay(sights, (0.0, 0.0), START_US + age_us, CAMERA, PLANNER)
        assert plan(grid, RESTING, AHEAD, None, PLANNER).speed_mps == 0.0


def test_a_boat_before_a_wall_turns_on_the_spot() -> None:
    """Fans that only push are off: they would drive it on while it turns."""
    fans = load_config(profile="fans").navigator.planner
    for start in (RESTING, CRUISING):
        found = plan(pool(bank_m=1.6), start, AHEAD, None, PLANNER)
        assert found.speed_mps == pytest.approx(PARTS[-1] * 0.6)
        assert abs(found.heading_rad) > 1.0
        assert plan(pool(bank_m=1.6), start, AHEAD, None, fans).speed_mps == 0.0


def test_what_turns_on_the_spot_turns_by_more_than_a_little() -> None:
    """A boat that may wait does not creep along."""
    for bank_m in np.arange(1.0, 4.0, 0.1).tolist():
        found = plan(pool(bank_m=bank_m), RESTING, AHEAD, None, PLANNER)
        assert found.speed_mps in (0.0, 0.3, 0.6) or abs(found.heading_rad) >= ON_THE_SPOT_RAD


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_boat_that_would_coast_onto_something_steers_past_it(side: float) -> None:
    """No way keeps off it any more, but with its fans off the boat keeps off less: it runs straight on."""
    low, high = sorted((0.1 * side, 0.4 * side))
    grid, start = pool((1.7, low, 2.0, high)), Start(0.9, 0.0, 0.0, 0.6)
    found = plan(grid, start, AHEAD, None, PLANNER)
    assert found.speed_mps > 0.0
    assert found.heading_rad * side < -0.3
    at_s, gap_m = swept_gap_m(grid, start, found)
    coast_m = standing_gaps_m(grid, coasting(start, at_s, PLANNER))
    soon = at_s <= PLANNER.horizon_s
    assert gap_m[soon].min() > coast_m[soon].min()


def test_a_boat_coasts_as_far_as_its_drag_lets_it() -> None:
    """0.1 m/s of 0.6 may be wind and goes on; the drag of K5 takes the rest in 0.78 m, sideways it stays."""
    at_s = np.linspace(0.0, 20.0, 201)
    way = coasting(Start(1.0, 2.0, math.pi / 2.0, 0.6, 0.0, 0.1), at_s, PLANNER)
    assert way.y_m[:, 0] - 2.0 == pytest.approx(way.way_m[:, 0], abs=1e-6)
    assert way.x_m[:, 0] == pytest.approx(1.0 - 0.1 * at_s, abs=1e-6)
    assert way.way_m[-1, 0] == pytest.approx(2.0 + 12.4 / 20.0 * math.log(1.0 + 20.0 * 0.5 / 4.0), abs=0.05)
    assert coasting(Start(0.0, 0.0, 0.0, 0.06), at_s, PLANNER).way_m[-1, 0] == pytest.approx(0.06 * 20.0)
    assert coasting(RESTING, at_s, PLANNER).way_m.max() == 0.0


def test_what_stands_in_the_way_is_passed_on_the_side_with_more_room() -> None:
    for side in (-1.0, 1.0):
        bar = (4.0, min(-0.3, side * 0.9), 4.6, max(0.3, side * 0.9))
        found = plan(pool(bar), CRUISING, AHEAD, None, PLANNER)
        assert found.speed_mps > 0.0
        assert found.heading_rad * side < -0.1


def test_a_side_once_chosen_is_kept() -> None:
    """As much room on either side: the plan before decides."""
    bar = (4.0, -0.4, 4.6, 0.4)
    for before in (0.35, -0.35):
        found = plan(pool(bar), CRUISING, AHEAD, Plan(before, 0.6), PLANNER)
        assert found.heading_rad * before > 0.0


def test_nothing_within_the_way_to_stop_may_be_unknown() -> None:
    """A boat that needs longer to stop goes slower, or not at all: it never outruns what was seen free."""
    near = msgspec.structs.replace(PLANNER, max_range_m=2.6)
    memory = seen()
    grid = lay(memory.sights, (0.0, 0.0), START_US, CAMERA, near)
    speeds = [
        plan(grid, RESTING, AHEAD, None, msgspec.structs.replace(near, stop_s=stop_s)).speed_mps
        for stop_s in (2.5, 6.0, 20.0, 40.0)
    ]
    assert speeds == [0.6, 0.3, 0.06, 0.0]
    blind = msgspec.structs.replace(PLANNER, blind_m=0.0)
    grid = lay(memory.sights, (0.0, 0.0), START_US, CAMERA, blind)
    assert plan(grid, RESTING, AHEAD, None, blind).speed_mps == 0.0


def test_what_went_out_of_sight_below_the_picture_is_still_there() -> None:
    """Seen 3 m ahead, then too near to be seen: the boat that drifted up to it does not run over it."""
    buoy = (3.0, -0.3, 3.5, 0.3)
    memory, at_us, boat = Memory(), START_US, AT_REST
    for x_m in np.arange(0.0, 1.9, 0.1).tolist():
        boat = BoatPose(x_m, 0.0, 0.0)
        memory, at_us = seen(boat, edge_of(boat, (buoy,)), at_us + 300_000, memory), at_us + 300_000
    assert max(edge_of(boat, (buoy,))) < 0.7  # it is not in the picture any more
    for _ in range(5):
        at_us += 300_000
        memory = seen(boat, at_us=at_us, memory=memory)
    grid = lay(memory.sights, (boat.x_m, 0.0), at_us, CAMERA, PLANNER)
    found = plan(grid, Start(boat.x_m, 0.0, 0.0), AHEAD, None, PLANNER)
    at_s, gap_m = swept_gap_m(grid, Start(boat.x_m, 0.0, 0.0), found)
    assert found.speed_mps == 0.0 or gap_m[at_s <= 3.0].min() > 0.5
    forgetful = lay(memory.sights, (boat.x_m, 0.0), at_us, CAMERA, PAPER)
    assert not forgetful.occupied[49:51, 50:58].any()


@pytest.mark.parametrize("course", [0.0, 0.8, -0.8, 2.0])
def test_a_boat_within_what_is_occupied_goes_no_deeper(course: float) -> None:
    """What came alongside covers the boat: full ahead through it is no way out, though no cell there is further off."""
    cells = np.zeros((CELLS, CELLS), np.bool_)
    cells[40:60, 49:62] = True  # the boat lies 0.2 m inside its western side
    grid = round_about(cells)
    found = plan(grid, RESTING, Wish(course, 0.6), None, PLANNER)
    if found.speed_mps > 0.0:
        assert clearance_along_m(grid, RESTING, found).min() >= -0.1 - 0.5 * CELL_M - LOSE_M
        assert abs(found.heading_rad) > 1.5


@pytest.mark.parametrize("gap_m", [0.3, 0.4, 0.5])
def test_a_boat_with_its_bow_aslant_to_something_turns_away_on_the_spot(gap_m: float) -> None:
    """That leads it out, though it is no further off within the horizon: it lay there until it was drifted onto."""
    row, column = np.indices((CELLS, CELLS))
    behind = column - 50 - np.rint(0.5 * (row - 50))
    cells = (behind >= 0) & (behind < 10)
    start = Start(-gap_m, 0.0, 0.0)
    lay = Plan(0.0, 0.0)
    found = plan(round_about(cells), start, Wish(1.9, 0.3), lay, PLANNER)
    assert found.speed_mps == pytest.approx(PARTS[-1] * 0.3)
    assert clearance_along_m(round_about(cells), start, found).min() >= gap_m - LOSE_M - 0.5 * CELL_M
    cells[:, :48] = cells[:48] = cells[52:] = True  # and in a corner that leads nowhere it lies still
    assert plan(round_about(cells), start, Wish(1.9, 0.3), lay, PLANNER).speed_mps == 0.0


@pytest.mark.parametrize("course", [1.2, 2.0, 2.8])
def test_a_boat_that_lay_still_turns_to_what_it_does_not_see_before_it_goes(course: float) -> None:
    """Something may have come up beside it: one went ahead, round, and into a hull that it had not seen for 30 s."""
    row, column = np.indices((CELLS, CELLS))
    cells = np.hypot(column - 49.5, row - 57.5) < 1.6  # abeam, 1.3 m off
    wish = Wish(course, 0.6)
    about = Plan(float(candidates(RESTING, wish, PLANNER)[0][0]), PARTS[-1] * 0.6)
    for before in (None, Plan(0.0, 0.0), Plan(course, PARTS[-1] * 0.6)):
        assert plan(round_about(cells), RESTING, wish, before, PLANNER) == about
    assert plan(round_about(cells), RESTING, wish, Plan(-2.0, PARTS[-1] * 0.6), PLANNER) != about  # it has looked there
    assert plan(round_about(cells), CRUISING, wish, Plan(0.0, 0.6), PLANNER) != about
    near = np.hypot(column - 49.5, row - 54.5) < 1.6
    assert plan(round_about(near), RESTING, wish, None, PLANNER) != about  # there is no room for it


@pytest.mark.parametrize("surge", [0.0, 0.6])
def test_near_anything_no_way_is_taken_at_full_speed(surge: float) -> None:
    """Beside a wall 0.5 m off, less than hull and Q6's margin, it goes at half the speed; at 2 m at the whole."""
    speeds = []
    for wall_m in (0.4, 2.0):
        cells = np.zeros((CELLS, CELLS), np.bool_)
        cells[50 + round(wall_m / CELL_M) : 60, :] = True
        speeds.append(plan(round_about(cells), Start(0.0, 0.0, 0.0, surge), AHEAD, None, PLANNER).speed_mps)
    assert speeds == [0.3, 0.6]


@settings(max_examples=10, deadline=None)
@given(cells=st.lists(st.tuples(st.integers(0, 99), st.integers(0, 99)), min_size=1, max_size=12))
def test_distances_are_those_to_the_nearest_cell(cells: list[tuple[int, int]]) -> None:
    mask = np.zeros((CELLS, CELLS), np.bool_)
    for row, column in cells:
        mask[row, column] = True
    rows, columns = np.indices(mask.shape)
    exact = np.min([np.hypot(rows - row, columns - column) for row, column in cells], axis=0) * CELL_M
    assert distance_m(mask) == pytest.approx(np.minimum(exact, 4.0))


def test_plans_repeat_bit_by_bit() -> None:
    """The same sights give the same plan to the last bit, whatever was computed in between."""
    bar = (4.0, -0.4, 4.6, 0.4)
    first = msgspec.json.encode(plan(pool(bar), CRUISING, Wish(0.123, 0.6), None, PLANNER))
    plan(pool(), RESTING, Wish(-1.0, 0.3, 1.0), None, PLANNER)
    assert msgspec.json.encode(plan(pool(bar), CRUISING, Wish(0.123, 0.6), None, PLANNER)) == first
