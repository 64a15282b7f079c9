"""What the map shows of the navigator's intent; it is made from the state and decides nothing."""

from __future__ import annotations

import math

import pytest
from msgspec.structs import replace

from paani import messages as m
from paani_services.navigator.avoidance.replanning import replan
from paani_services.navigator.avoidance.rollout import GuidanceSetpoint
from paani_services.navigator.guidance.mission_progress import MissionProgress
from paani_services.navigator.navigate import NavigatorState
from paani_services.navigator.predict import predict
from tests.synthetic_water import AT_REST, CAMERA, CONFIG, PLANNER, odometry
from tests.unit.paani_services.navigator.mapping.test_track_identity import person_of, watch

NAVIGATOR = replace(CONFIG.navigator, planner=PLANNER)
AHEAD = m.NavCommand(source_us=0, enable=True, heading_rad=math.pi / 2, speed_mps=0.5)
STILL = m.NavCommand(source_us=0, enable=False, heading_rad=0.0, speed_mps=0.0, inhibits=(m.Inhibit.NOT_ARMED,))
HOME = m.Waypoint(x_m=-3.0, y_m=4.0)


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


def test_the_reasons_of_the_plan_are_told_while_the_boat_is_steered_by_it() -> None:
    planner, _, now_us = watch(4, with_tracks=True)
    here = odometry(now_us, AT_REST)
    planner, plan = replan(planner, here, GuidanceSetpoint(0.3, 0.6), now_us, CAMERA, PLANNER)
    state = NavigatorState(planner_state=planner)
    headings = predict(state, AHEAD, here, None, now_us, CAMERA, NAVIGATOR).headings
    assert headings == planner.verdicts
    assert headings[0].heading_rad == pytest.approx(0.3)
    assert plan.heading_rad in [each.heading_rad for each in headings]
    assert predict(state, AHEAD, here, None, now_us + 1_100_000, CAMERA, NAVIGATOR).headings == ()


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
        for state, task in ((NavigatorState(), None), (began, None), (began, unnamed), (began, mission))
    ]
    assert found == [(), (HOME,), (HOME,), (named,)]
