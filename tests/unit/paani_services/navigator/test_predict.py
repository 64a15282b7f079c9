"""What the map shows of the navigator's intent; it is made from the state and decides nothing."""

from __future__ import annotations

import math

import msgspec
import pytest
from msgspec.structs import replace

from paani import messages as m
from paani.motion_planning import HeadingSpeed
from paani_services.navigator.avoidance.fence_cells import apply_fence
from paani_services.navigator.avoidance.replanning import PlannerState, explain_plan, observe, replan
from paani_services.navigator.avoidance.rollout import BoatState, GuidanceSetpoint, Plan
from paani_services.navigator.guidance.mission_progress import MissionProgress
from paani_services.navigator.mapping.water_map import map_water
from paani_services.navigator.navigate import NavigatorState
from paani_services.navigator.predict import predict
from paani_sim.eye.camera import BoatPose
from tests.synthetic_scans import SCAN_US, scan_from
from tests.synthetic_water import (
    AT_REST,
    CAMERA,
    CONFIG,
    EMPTY_MEMORY,
    PLANNER,
    START_US,
    evidence,
    explain_motion,
    odometry,
)
from tests.unit.paani_services.navigator.mapping.test_track_identity import person_of, watch

NAVIGATOR = replace(CONFIG.navigator, planner=PLANNER)
AHEAD = m.NavCommand(source_us=0, enable=True, heading_rad=math.pi / 2, speed_mps=0.5)
STILL = m.NavCommand(source_us=0, enable=False, heading_rad=0.0, speed_mps=0.0, inhibits=(m.Inhibit.NOT_ARMED,))
HOME = m.Waypoint(x_m=-3.0, y_m=4.0)
CORNERS = tuple(m.Waypoint(x_m=x_m, y_m=y_m) for x_m, y_m in ((90.0, 40.0), (110.0, 40.0), (110.0, 52.5), (90.0, 52.5)))
FENCE = (m.FenceArea(keep=m.Keep.IN, corners=CORNERS),)


def test_moving_obstacles_stand_in_the_map_with_number_and_velocity() -> None:
    """The frame of dead reckoning may lie anywhere in the map."""
    planner, tracks, now_us = watch(16, with_tracks=True)
    planner, _ = replan(planner, odometry(now_us, AT_REST), GuidanceSetpoint(0.0, 0.6), now_us, CAMERA, PLANNER)
    here = replace(odometry(now_us, AT_REST), x_m=100.0, y_m=50.0)
    (seen,) = predict(NavigatorState(planner_state=planner), STILL, here, None, now_us, CAMERA, NAVIGATOR).obstacles
    assert seen.track_id == person_of(tracks).id
    assert (seen.x_m, seen.y_m) == pytest.approx((105.0, 50.5), abs=0.5)
    assert (seen.east_mps, seen.north_mps) == pytest.approx((0.0, 0.5), abs=0.2)
    assert 0.1 < seen.radius_m < 1.0


def test_encounters_are_told_with_their_closest_point_and_keep_their_class() -> None:
    """A swimmer crosses the bow of a boat at rest from starboard, 5 m off; once past they are met no more."""
    planner, tracks, now_us = watch(16, with_tracks=True)
    here = replace(odometry(now_us, AT_REST), surge_mps=0.4)
    planner, _ = replan(planner, here, GuidanceSetpoint(0.0, 0.6), now_us, CAMERA, PLANNER)
    state, waiting = NavigatorState(planner_state=planner), replace(AHEAD, speed_mps=0.0)

    def ahead(before: m.EncounterClass | None) -> m.Prediction:
        prediction = predict(state, waiting, here, None, now_us, CAMERA, NAVIGATOR)
        (seen,) = prediction.obstacles
        if before is None:
            return prediction
        prediction = replace(prediction, obstacles=(replace(seen, encounter=before),))
        return predict(state, waiting, here, None, now_us, CAMERA, NAVIGATOR, prediction)

    (seen,) = ahead(None).obstacles
    assert isinstance(seen.cpa_m, float)
    assert isinstance(seen.tcpa_s, float)
    assert isinstance(seen.cpa_std_m, float)
    assert 0.0 < seen.tcpa_s < 10.0
    assert 0.0 < seen.cpa_m < 5.0
    assert 0.0 < seen.cpa_std_m < 3.0
    for before in (m.EncounterClass.CROSSING_PORT, m.EncounterClass.CROSSING_STARBOARD):
        kept = ahead(before)
        assert kept.obstacles[0].encounter is before
        side = before.value.removeprefix("crossing_")
        number = person_of(tracks).id
        assert kept.courtesy == f"Give way: person #{number} crossing from {side}, waiting until it is past"


def test_what_a_scanner_meets_has_no_name_by_which_it_could_keep_a_class() -> None:
    """A hull from port: the class of another echo of before is not its own."""
    memory, now_us = EMPTY_MEMORY, START_US
    for number in range(16):
        now_us = START_US + number * SCAN_US
        north_m = 6.0 - 0.8 * number * SCAN_US * 1e-6
        memory = scan_from(now_us, AT_REST, ((4.0, north_m, 5.0, north_m + 1.0),), memory)
    state = NavigatorState(planner_state=PlannerState(memory, planned_us=now_us))

    def scanned(before: m.Prediction | None) -> m.Prediction:
        return predict(state, AHEAD, odometry(now_us, AT_REST), None, now_us, CAMERA, NAVIGATOR, before)

    first = scanned(None)
    (met,) = first.obstacles
    assert (met.track_id, met.mmsi) == (0, 0)
    assert met.encounter is not m.EncounterClass.OVERTAKING
    other = replace(met, encounter=m.EncounterClass.OVERTAKING)
    assert scanned(replace(first, obstacles=(other,))).obstacles == first.obstacles


@pytest.mark.parametrize(
    ("frames", "setpoint", "waited_us"),
    [
        (16, GuidanceSetpoint(0.3, 0.6, 1.0), 0),
        (4, GuidanceSetpoint(0.3, 0.6, 1.0), 60_000_000),  # whether the person swims is unknown, and it waits no longer
        (16, GuidanceSetpoint(0.0, 0.6, 1.0, is_pivot_only=True), 0),
    ],
)
def test_the_reasons_told_are_those_of_the_plan_in_force_until_it_is_old(
    frames: int, setpoint: GuidanceSetpoint, waited_us: int
) -> None:
    """They are told by asking the planner again, also of a recorded state, after the boat has gone on."""
    planner, _, now_us = watch(frames, with_tracks=True)
    planner = replace(planner, waiting_since_us=now_us - waited_us, plan=Plan(0.1, 0.6))
    away = replace(odometry(now_us, AT_REST), x_m=100.0, y_m=50.0, surge_mps=0.3, sway_mps=0.05, yaw_rate_radps=0.1)
    after, plan = replan(planner, away, setpoint, now_us, CAMERA, PLANNER, FENCE)
    grid, obstacles = map_water(planner.memory.observations, (0.0, 0.0), now_us, CAMERA, PLANNER)
    grid, start = apply_fence(grid, FENCE, (100.0, 50.0)), BoatState(0.0, 0.0, 0.0, 0.3, 0.1, 0.05)
    planned, verdicts = explain_motion(grid, start, setpoint, planner.plan, PLANNER, obstacles, may_wait=waited_us == 0)
    assert planned == plan
    assert len({each.refused_by for each in verdicts}) > 1
    gone_on = observe(after, odometry(now_us + 200_000, BoatPose(0.7, 0.0, 0.05), 3.5), None, PLANNER)
    recorded = msgspec.json.decode(msgspec.json.encode(gone_on), type=PlannerState)
    mission = m.Mission(source_us=0, name="fenced", legs=(), fence=FENCE)

    def headings_told(state: PlannerState, after_us: int = 200_000) -> tuple[m.HeadingVerdict, ...]:
        later = NavigatorState(planner_state=state)
        return predict(later, AHEAD, away, mission, now_us + after_us, CAMERA, NAVIGATOR).headings

    assert headings_told(after) == headings_told(recorded) == verdicts
    assert headings_told(after, 1_100_000) == ()


def test_no_reasons_are_told_of_a_plan_that_is_no_more_what_the_planner_would_do() -> None:
    """Another planner made it, a newer picture or another fence came since, or the memory began anew."""
    planner, _, now_us = watch(4, with_tracks=True)
    here, ahead = odometry(now_us, AT_REST), GuidanceSetpoint(0.3, 0.6)
    planned, plan = replan(planner, here, ahead, now_us, CAMERA, PLANNER)
    same = HeadingSpeed(plan.heading_rad, plan.speed_mps)
    other, _ = replan(planner, here, ahead, now_us, CAMERA, PLANNER, planner=lambda _: same)
    newer = observe(planned, None, evidence(now_us + 10_000, ()), PLANNER)
    anew = observe(planned, odometry(now_us + 10_000, AT_REST, epoch=7), None, PLANNER)
    for state, is_told in ((planned, True), (other, False), (newer, False), (anew, False)):
        assert bool(explain_plan(state, CAMERA, PLANNER)) is is_told
    corners = tuple(m.Waypoint(x_m=x_m, y_m=y_m) for x_m, y_m in ((-3.0, -3.0), (2.0, -3.0), (2.0, 3.0), (-3.0, 3.0)))
    fence = (m.FenceArea(keep=m.Keep.IN, corners=corners),)
    assert explain_plan(planned, CAMERA, PLANNER, fence) == ()


def test_the_way_ahead_leads_to_the_ordered_heading_and_is_none_where_the_boat_may_not_move() -> None:
    here = replace(odometry(1_000_000, AT_REST), x_m=100.0, y_m=50.0, surge_mps=0.5)
    path = predict(NavigatorState(), AHEAD, here, None, 1_000_000, CAMERA, NAVIGATOR).path
    assert (path[0].x_m, path[0].y_m) == (100.0, 50.0)
    assert 0.3 < path[-1].y_m - 50.0 < 0.6 * PLANNER.horizon_s
    assert len(path) < 20
    assert predict(NavigatorState(), STILL, here, None, 1_000_000, CAMERA, NAVIGATOR).path == ()
    assert predict(NavigatorState(), AHEAD, None, None, 1_000_000, CAMERA, NAVIGATOR).path == ()


def test_home_is_the_missions_before_where_the_boat_set_out() -> None:
    began = NavigatorState(progress=MissionProgress(home=HOME))
    named = m.Waypoint(x_m=7.0, y_m=8.0)
    leg = m.MissionLeg(kind=m.LegKind.RETURN_HOME, waypoints=(named,))
    mission = m.Mission(source_us=0, name="out and home", legs=(leg,))
    unnamed = replace(mission, legs=(m.MissionLeg(kind=m.LegKind.RETURN_HOME),))
    found = [
        predict(state, STILL, None, task, 1, CAMERA, NAVIGATOR).home
        for state, task in (
            (NavigatorState(), None), (began, None), (began, unnamed), (began, mission),
            (began, replace(unnamed, home=(named,))), (began, replace(mission, legs=(), home=(named,))),
        )
    ]  # fmt: skip
    assert found == [(), (HOME,), (HOME,), (named,), (named,), (named,)]
