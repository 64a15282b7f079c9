"""What holds the boat stands alone: each interlock stops it, and what it stops leaves no trace in the state."""

from __future__ import annotations

import math

import msgspec
import pytest

from paani import messages as m
from paani.config import NavigatorConfig
from paani.messages import Direction, FenceArea, Inhibit, Keep, NavCommand, Purpose, SimTime, Waypoint
from paani.missions import mission_of_route
from paani.motion_planning import HeadingSpeed, MotionPlanner, PlanningInputs
from paani_services.navigator.avoidance.replanning import observe
from paani_services.navigator.avoidance.rollout import PIVOT_SPEED_FRACTION, RESIDUAL_DRIFT_MPS
from paani_services.navigator.guidance.ilos import IlosState
from paani_services.navigator.guidance.mission_progress import MissionProgress
from paani_services.navigator.guidance.visual_turns import VisualTurn
from paani_services.navigator.interlocks import NavigatorInputs, is_out_of_date
from paani_services.navigator.modes import follow_order
from paani_services.navigator.navigate import (
    NavigatorState,
    begin_step,
    build_command,
    navigate,
    note_clock_advance,
    speed_limit_mps,
)
from paani_sim.eye.camera import BoatPose
from tests.synthetic_water import CAMERA, COLUMNS, evidence, water_edge_of
from tests.unit.paani_services.navigator.test_navigate import (
    NOW_US,
    PAANI,
    PAPER,
    RUNNING,
    SQUARE,
    advice,
    inputs,
    pose,
)

MISSION = mission_of_route(SQUARE)
POOL = FenceArea(
    keep=Keep.IN, corners=tuple(Waypoint(x_m=x, y_m=y) for x, y in ((-5, -5), (30, -5), (30, 30), (-5, 30)))
)
FENCED = msgspec.structs.replace(MISSION, fence=(POOL,))
OUTSIDE = pose(31.0, 0.0)
TRACK_OF_FIRST_BOX = m.Track(
    id=4, label=m.Label.PERSON, hazard=m.Hazard.SWIMMER, confidence=0.9, box_xyxy=(0.4, 0.5, 0.6, 0.7), hits=2,
    confirmed=True, immediate_danger=False, accepted=True, held=False, age_s=0.4, urgency=0.0, detection_number=1,
)  # fmt: skip


def test_a_disabled_order_has_neither_heading_nor_speed() -> None:
    """Whoever reads an order without looking at `enable` still gets no motion."""
    given_inputs = inputs()
    moving = build_command(RUNNING, given_inputs, NOW_US, [], 1.0, 0.4, astern_mps=0.2)
    assert (moving.enable, moving.heading_rad, moving.speed_mps, moving.astern_mps) == (True, 1.0, 0.4, 0.2)
    held = build_command(RUNNING, given_inputs, NOW_US, [Inhibit.IDLE], 1.0, 0.4, astern_mps=0.2)
    assert (held.enable, held.heading_rad, held.speed_mps, held.astern_mps) == (False, 0.0, 0.0, 0.0)
    plain = build_command(RUNNING, given_inputs, NOW_US, [])
    assert (plain.heading_rad, plain.speed_mps, plain.astern_mps, plain.vetoes, plain.leg) == (0.0, 0.0, 0.0, (), "")


def test_an_order_without_inputs_says_that_there_are_none() -> None:
    order = build_command(NavigatorState(), NavigatorInputs(), NOW_US, [Inhibit.NO_ADVISORY])
    assert (order.source_us, order.echo_us, order.advisory_sent_us) == (NOW_US, 0, 0)
    assert (order.direction, order.waypoint_index) == (Direction.NO_DATA, 0)


def test_an_order_carries_the_progress_of_the_mission() -> None:
    state = NavigatorState(progress=MissionProgress(target=2, waypoints_reached=5, leg_index=3))
    vetoes = (Inhibit.BLOCKED_AHEAD,)
    order = build_command(
        state, inputs(), NOW_US, [], cross_m=0.5, leg="transit", vetoes=vetoes, obstacle_track_ids=(4,)
    )
    assert (order.waypoint_index, order.waypoints_reached, order.leg_index) == (2, 5, 3)
    assert (order.cross_track_m, order.leg) == (0.5, "transit")
    assert (order.vetoes, order.obstacle_track_ids, order.direction) == (vetoes, (4,), Direction.STRAIGHT)


def test_an_unhealthy_estimate_moves_nothing_in_the_state() -> None:
    """Neither the mission nor what was passed is counted by a place that is in doubt."""
    beside = msgspec.structs.replace(advice(Direction.LEFT), left=m.LaneRisk(occupied=True))
    doubtful = msgspec.structs.replace(pose(9.9, 0.0), healthy=False)
    state, order = navigate(RUNNING, inputs(odometry=doubtful, advisory=beside), MISSION, NOW_US, 43, PAANI)
    assert order.inhibits == (Inhibit.UNHEALTHY_ODOMETRY,)
    assert (order.leg, order.cross_track_m) == ("", 0.0)
    blind, order = navigate(RUNNING, inputs(odometry=doubtful, advisory=None), MISSION, NOW_US, 43, PAANI)
    assert (order.source_us, blind.passed_obstacles) == (NOW_US, RUNNING.passed_obstacles)
    assert (state.passed_obstacles, state.progress) == (RUNNING.passed_obstacles, RUNNING.progress)
    near = msgspec.structs.replace(PAANI, clear_m=0.5)
    healthy, _ = navigate(RUNNING, inputs(odometry=pose(9.9, 0.0), advisory=beside), MISSION, NOW_US, 43, near)
    assert healthy.passed_obstacles != RUNNING.passed_obstacles


@pytest.mark.parametrize("direction", [Direction.STOP, Direction.LEFT, None])
def test_what_does_not_follow_its_path_holds_the_integral_over_this_step(direction: Direction | None) -> None:
    """So that this time is not integrated later; the order still says how far off the path the boat is."""
    advisory = None if direction is None else advice(direction)
    state, order = navigate(RUNNING, inputs(odometry=pose(3.0, -2.0), advisory=advisory), MISSION, NOW_US, 43, PAANI)
    assert (state.ilos, order.source_us) == (IlosState(0.0, 0.0, NOW_US), NOW_US)
    assert order.cross_track_m == pytest.approx(-2.0)


def test_the_integral_runs_with_any_look_ahead() -> None:
    near = msgspec.structs.replace(PAANI, lookahead_m=0.5)
    before = msgspec.structs.replace(RUNNING, ilos=IlosState(updated_us=NOW_US - 100_000))
    state, _ = navigate(before, inputs(odometry=pose(3.0, -0.2)), MISSION, NOW_US, 43, near)
    assert state.ilos.north_m < 0.0


def test_the_next_leg_begins_without_the_integral_of_the_one_before() -> None:
    first = msgspec.structs.replace(MISSION.legs[0], waypoints=SQUARE.waypoints[:2], repeat=False)
    before = msgspec.structs.replace(RUNNING, ilos=IlosState(east_m=0.5, north_m=0.5, updated_us=NOW_US))
    mission = msgspec.structs.replace(MISSION, legs=(first, *MISSION.legs))
    state, order = navigate(before, inputs(odometry=pose(9.9, 0.0)), mission, NOW_US, 43, PAANI)
    assert (order.leg_index, state.ilos) == (1, IlosState(0.0, 0.0, NOW_US))


def test_the_mission_notes_which_run_of_the_operators_process_armed_the_boat() -> None:
    armed = m.Arming(source_us=NOW_US, armed=True, epoch=9)
    assert navigate(RUNNING, inputs(arming=armed), MISSION, NOW_US, 43, PAANI)[0].progress.armed_epoch == 9


@pytest.mark.parametrize("direction", [Direction.STRAIGHT, Direction.LEFT])
def test_outside_the_fence_no_turn_begins_and_no_integral_runs(direction: Direction) -> None:
    state, order = navigate(RUNNING, inputs(odometry=OUTSIDE, advisory=advice(direction)), FENCED, NOW_US, 43, PAANI)
    assert (order.enable, order.inhibits) == (False, (Inhibit.OUTSIDE_FENCE,))
    assert state.turn is None
    assert (order.leg, order.cross_track_m) == ("follow route, lap 1", 0.0)
    returning = msgspec.structs.replace(PAANI, fence_return=True)
    back = pose(31.0, 0.0, yaw_rad=math.pi)
    _, order = navigate(RUNNING, inputs(odometry=back), FENCED, NOW_US, 43, returning)
    assert (order.enable, order.inhibits) == (True, ())


def test_before_the_edge_the_boat_may_not_go_on() -> None:
    fast = msgspec.structs.replace(pose(29.9, 0.0), surge_mps=0.6)
    _, order = navigate(RUNNING, inputs(odometry=fast, advisory=advice(Direction.LEFT)), FENCED, NOW_US, 43, PAANI)
    assert (order.enable, order.inhibits, order.speed_mps) == (False, (Inhibit.OUTSIDE_FENCE,), 0.0)


def planned(
    planner: MotionPlanner, state: NavigatorState = RUNNING, surge_mps: float = 0.0, **changes: object
) -> tuple[NavigatorState, NavCommand]:
    """One step with a valid calibration, with this planner in place of the navigator's own."""
    at = msgspec.structs.replace(pose(3.0, 0.0), surge_mps=surge_mps)
    return navigate(state, inputs(**{"odometry": at} | changes), MISSION, NOW_US, 43, PAANI, CAMERA, planner)


def aside(given: PlanningInputs) -> HeadingSpeed:
    """To port of the course, at the speed asked for."""
    return HeadingSpeed(given.course_rad + 0.3, given.speed_mps)


def halt(given: PlanningInputs) -> HeadingSpeed:
    return HeadingSpeed(given.yaw_rad, 0.0)


def test_a_plan_without_speed_is_no_free_path() -> None:
    state, order = planned(halt)
    assert (order.enable, order.inhibits, order.speed_mps) == (False, (Inhibit.NO_FREE_PATH,), 0.0)
    assert state.planner_state.waiting_since_us == NOW_US


def test_a_boat_with_way_on_is_still_ordered_to_brake() -> None:
    """For as long as it may brake, and while its way is more than wind and current may cause."""
    state, order = planned(halt, surge_mps=RESIDUAL_DRIFT_MPS + 0.01)
    assert (order.enable, order.inhibits, order.speed_mps) == (True, (), 0.0)
    since_us = NOW_US - round(PAANI.planner.brake_s * 1e6)
    waiting = msgspec.structs.replace(
        state, planner_state=msgspec.structs.replace(state.planner_state, plan=None, waiting_since_us=since_us)
    )
    _, order = planned(halt, waiting, surge_mps=RESIDUAL_DRIFT_MPS + 0.01)
    assert order.inhibits == (Inhibit.NO_FREE_PATH,)


def test_a_plan_is_sailed_at_its_own_heading_and_speed() -> None:
    state, order = planned(aside)
    assert order.heading_rad == pytest.approx(0.3)
    assert order.speed_mps == pytest.approx(min(PAANI.cruise_mps, PAANI.planner.speed_mps))
    assert (order.obstacle_track_ids, state.planner_state.advised_side) == ((), 0.0)
    assert state.ilos.updated_us == NOW_US, "held beside the course"
    state, order = planned(aside, advisory=advice(Direction.LEFT))
    assert state.planner_state.advised_side == 1.0
    assert order.speed_mps == pytest.approx(0.5 * PAANI.cruise_mps)
    assert order.heading_rad == pytest.approx(0.3)  # the map decides where, not the angle of a visual turn


HALTED = msgspec.structs.replace(advice(Direction.STRAIGHT), speed_limit_mps=0.0)


@pytest.mark.parametrize(
    ("advisory", "inhibits"),
    [
        (advice(Direction.STOP), (Inhibit.ADVISED_STOP,)),
        (advice(Direction.NO_DATA), (Inhibit.ADVISED_NO_DATA,)),
        (HALTED, ()),
    ],
)
def test_no_plan_is_made_where_the_advice_forbids_motion(advisory: m.Advisory, inhibits: tuple[Inhibit, ...]) -> None:
    asked: list[PlanningInputs] = []

    def count(given: PlanningInputs) -> HeadingSpeed:
        asked.append(given)
        return aside(given)

    _, order = planned(count, advisory=advisory)
    assert (order.inhibits, order.speed_mps, asked) == (inhibits, 0.0, [])


@pytest.mark.parametrize(("mission", "is_shut_in"), [(MISSION, False), (FENCED, True)])
def test_the_planner_is_shown_the_fence(mission: m.Mission, is_shut_in: bool) -> None:
    def look(given: PlanningInputs) -> HeadingSpeed:
        assert given.occupied.any() == is_shut_in
        return aside(given)

    assert navigate(RUNNING, inputs(), mission, NOW_US, 43, PAANI, CAMERA, look)[1].enable


def test_an_order_names_the_tracks_that_its_plan_was_made_for() -> None:
    state, _ = planned(aside)
    tracked = msgspec.structs.replace(
        state, planner_state=msgspec.structs.replace(state.planner_state, obstacle_track_ids=(4,))
    )
    assert planned(aside, tracked)[1].obstacle_track_ids == (4,)
    assert navigate(tracked, inputs(), MISSION, NOW_US, 43, PAANI)[1].obstacle_track_ids == (), "without a plan"


def test_the_map_is_told_the_tracks_of_its_boxes() -> None:
    person = m.Detection(label=m.Label.PERSON, confidence=0.9, box_xyxy=(0.4, 0.5, 0.6, 0.7))
    seen = evidence(NOW_US, (0.5,) * COLUMNS, detections=(person,))
    tracks = m.Tracks(
        source_us=NOW_US, frame_seq=seen.frame_seq, frame_epoch=seen.frame_epoch, tracks=(TRACK_OF_FIRST_BOX,)
    )
    given_inputs = inputs(evidence=seen, tracks=tracks)
    state, _ = begin_step(RUNNING, given_inputs, NOW_US, 43, PAANI, CAMERA)
    assert state.planner_state == observe(RUNNING.planner_state, given_inputs.odometry, seen, PAANI.planner, tracks)
    assert state.planner_state.memory.observations[-1].box_track_ids == (TRACK_OF_FIRST_BOX.id,)


def test_with_a_map_a_turn_may_reach_a_waypoint() -> None:
    """M1 holds for visual turns alone: the planner steers for the route whatever is advised."""
    at_waypoint = pose(9.9, 0.0)
    _, order = planned(aside, odometry=at_waypoint, advisory=advice(Direction.LEFT))
    assert order.waypoint_index == 2
    _, order = planned(aside, odometry=at_waypoint, advisory=advice(Direction.STOP))
    assert order.waypoint_index == 1


@pytest.mark.parametrize(
    ("direction", "purpose", "blocked", "is_pivot"),
    [
        (Direction.LEFT, Purpose.LOOK, "", True),
        (Direction.LEFT, Purpose.PASS, "left", False),
        (Direction.LEFT, Purpose.UNSAID, "left", True),
        (Direction.LEFT, Purpose.UNSAID, "right", False),
        (Direction.RIGHT, Purpose.UNSAID, "right", True),
        (Direction.RIGHT, Purpose.UNSAID, "left", False),
        (Direction.SLIGHT_LEFT, Purpose.UNSAID, "left", True),
        (Direction.STRAIGHT, Purpose.UNSAID, "left", False),
        (Direction.STRAIGHT, Purpose.UNSAID, "right", False),
    ],
)
def test_a_turn_to_look_is_a_pivot_and_no_way_ahead(
    direction: Direction, purpose: Purpose, blocked: str, is_pivot: bool
) -> None:
    """On open water that the map shows. A recorded advisory that does not say it looks where its side is blocked."""
    advisory = msgspec.structs.replace(
        advice(direction),
        purpose=purpose,
        left=m.LaneRisk(blocked=blocked == "left"),
        right=m.LaneRisk(blocked=blocked == "right"),
    )
    seen = evidence(NOW_US, water_edge_of(BoatPose(3.0, 0.0, 0.0)))
    given_inputs = inputs(advisory=advisory, evidence=seen, odometry=msgspec.structs.replace(pose(3, 0), surge_mps=0.0))
    _, order = navigate(RUNNING, given_inputs, MISSION, NOW_US, 43, PAANI, CAMERA)
    assert order.enable
    assert (order.speed_mps <= PIVOT_SPEED_FRACTION * PAANI.cruise_mps) is is_pivot


@pytest.mark.parametrize(("limit_mps", "ordered_mps"), [(0.2, 0.2), (5.0, 0.6), (0.0, 0.0)])
def test_an_advised_limit_lowers_the_speed_and_never_raises_it(limit_mps: float, ordered_mps: float) -> None:
    slow = msgspec.structs.replace(advice(Direction.STRAIGHT), speed_limit_mps=limit_mps)
    assert speed_limit_mps(slow) == limit_mps
    _, order = navigate(RUNNING, inputs(advisory=slow), MISSION, NOW_US, 43, PAANI)
    assert order.speed_mps == ordered_mps


def test_without_a_limit_there_is_none() -> None:
    assert speed_limit_mps(None) == speed_limit_mps(advice(Direction.STRAIGHT)) == math.inf


@pytest.mark.parametrize("profile", [PAPER, PAANI])
def test_a_stamp_is_out_of_date_beyond_its_limit_and_in_the_future(profile: NavigatorConfig) -> None:
    future_us = round(profile.max_future_s * 1e6)
    for age_us, is_old in ((0, False), (500_000, False), (500_001, True), (-future_us, False), (-future_us - 1, True)):
        assert is_out_of_date(NOW_US - age_us, 0.5, NOW_US, profile) is is_old
    exact = msgspec.structs.replace(profile, max_future_s=0.5)
    assert not is_out_of_date(NOW_US + 500_000, 0.5, NOW_US, exact)


@pytest.mark.parametrize("kind", ["advisory", "odometry", "clock", "arming", "evidence"])
def test_m9_one_message_of_another_domain_stops_the_boat(kind: str) -> None:
    """M9: each kind by itself."""
    given_inputs = inputs(evidence=evidence(NOW_US, (0.5,) * COLUMNS))
    assert navigate(RUNNING, given_inputs, MISSION, NOW_US, 43, PAANI)[1].enable
    foreign = msgspec.structs.replace(getattr(given_inputs, kind), domain=44)
    _, order = navigate(RUNNING, msgspec.structs.replace(given_inputs, **{kind: foreign}), MISSION, NOW_US, 43, PAANI)
    assert order.inhibits == (Inhibit.WRONG_DOMAIN,)


@pytest.mark.parametrize("number", ["x_m", "y_m", "yaw_rad"])
def test_m11_each_number_of_the_estimate_has_to_be_finite(number: str) -> None:
    for value in (math.nan, math.inf):
        at = msgspec.structs.replace(pose(3.0, 0.0), **{number: value})
        assert navigate(RUNNING, inputs(odometry=at), MISSION, NOW_US, 43, PAANI)[1].inhibits == (
            Inhibit.UNHEALTHY_ODOMETRY,
        )


def test_a_clock_that_stands_still_for_too_long_stops_the_boat() -> None:
    """M9: simulated time has to have moved forward within the limit; the first time heard is no movement."""
    stands = SimTime(source_us=NOW_US, sim_us=RUNNING.sim_us, stamp_us=1)
    limit_us = round(PAANI.clock_max_age_s * 1e6)
    for age_us, inhibits in ((limit_us, ()), (limit_us + 1, (Inhibit.CLOCK_STOPPED,))):
        state = msgspec.structs.replace(RUNNING, clock_advanced_us=NOW_US - age_us)
        assert navigate(state, inputs(clock=stands), MISSION, NOW_US, 43, PAANI)[1].inhibits == inhibits
    fresh = NavigatorState(progress=RUNNING.progress)
    state, order = navigate(fresh, inputs(clock=stands), MISSION, NOW_US, 43, PAANI)
    assert (order.inhibits, state.sim_us, state.clock_advanced_us) == ((Inhibit.CLOCK_STOPPED,), stands.sim_us, None)


def test_a_clock_that_is_set_back_forgets_all_but_the_count() -> None:
    turning = msgspec.structs.replace(
        RUNNING,
        progress=MissionProgress(target=2, waypoints_reached=7),
        ilos=IlosState(east_m=1.5),
        turn=VisualTurn(Direction.LEFT, 0.0, 0.5),
    )
    back = inputs(clock=SimTime(source_us=NOW_US, sim_us=RUNNING.sim_us - 1, stamp_us=1))
    after = note_clock_advance(turning, back, NOW_US)
    assert after == NavigatorState(progress=MissionProgress(waypoints_reached=7), sim_us=RUNNING.sim_us - 1)
    assert note_clock_advance(turning, NavigatorInputs(), NOW_US) is turning
    at_start = NavigatorState(sim_us=0)
    first = inputs(clock=SimTime(source_us=NOW_US, sim_us=50, stamp_us=1))
    assert note_clock_advance(at_start, first, NOW_US).clock_advanced_us == NOW_US


@pytest.mark.parametrize(
    ("changes", "ends"),
    [
        ({}, True),
        ({"advisory": advice(Direction.LEFT)}, False),
        ({"advisory": advice(Direction.STOP)}, False),
        ({"advisory": None}, False),
        ({"advisory": advice(Direction.STOP), "arming": None}, True),
        ({"advisory": advice(Direction.STOP), "arming": m.Arming(source_us=NOW_US, armed=False)}, True),
        ({"advisory": advice(Direction.STOP), "arming": m.Arming(source_us=NOW_US, armed=True, stopped=True)}, True),
    ],
)
def test_a_visual_turn_ends_with_straight_advice_or_disarming_alone(changes: dict[str, object], ends: bool) -> None:
    first, _ = navigate(RUNNING, inputs(advisory=advice(Direction.LEFT)), MISSION, NOW_US, 43, PAANI)
    assert first.turn is not None
    after, _ = navigate(first, inputs(**changes), MISSION, NOW_US, 43, PAANI)
    assert (after.turn is None) is ends


def test_other_legs_begin_without_the_integral_of_those_before_and_with_their_home() -> None:
    before = msgspec.structs.replace(
        RUNNING,
        progress=MissionProgress(target=2, waypoints_reached=4, home=Waypoint(x_m=1.0, y_m=2.0)),
        ilos=IlosState(east_m=1.5, updated_us=NOW_US),
    )
    route = m.OperatorOrder(source_us=NOW_US, mode=m.DriveMode.ROUTE, mission_us=7)
    other = msgspec.structs.replace(MISSION, legs_us=7)
    given_inputs = inputs(order=route, order_us=NOW_US, advisory=advice(Direction.STOP))
    state, _ = follow_order(before, given_inputs, other, NOW_US, 43, PAANI)
    assert (state.ilos.east_m, state.progress.home, state.legs_us) == (0.0, Waypoint(x_m=1.0, y_m=2.0), 7)


@pytest.mark.parametrize(("mode", "leg"), [(m.DriveMode.IDLE, "idle"), (m.DriveMode.HOLD, "")])
def test_a_stale_order_is_no_leg_but_that_of_idle(mode: m.DriveMode, leg: str) -> None:
    order = m.OperatorOrder(source_us=NOW_US, mode=mode)
    old_us = NOW_US - round(PAANI.order_max_age_s * 1e6) - 1
    _, command = follow_order(RUNNING, inputs(order=order, order_us=old_us), MISSION, NOW_US, 43, PAANI)
    assert (command.enable, command.inhibits, command.leg) == (False, (Inhibit.STALE_ORDER,), leg)


def test_a_boat_without_a_mission_keeps_the_place_it_has_in_the_one_before() -> None:
    idle = m.OperatorOrder(source_us=NOW_US, mode=m.DriveMode.IDLE)
    state, _ = follow_order(RUNNING, inputs(order=idle, order_us=NOW_US), None, NOW_US, 43, PAANI)
    assert (state.progress, state.legs_us) == (RUNNING.progress, 0)
