"""A boat with a range scanner keeps off what no camera looks at."""

from __future__ import annotations

import math

import pytest
from msgspec.structs import replace

from paani import messages as m
from paani.config import NavigatorConfig
from paani.geometry import wrap_rad
from paani_services.navigator.avoidance.replanning import PlannerState, explain_plan, observe, replan
from paani_services.navigator.avoidance.rollout import GuidanceSetpoint, Plan
from paani_services.navigator.mapping.observation import ObservationMemory
from paani_services.navigator.navigate import NavigatorState
from paani_services.navigator.predict import predict
from tests.synthetic_scans import SCAN_US, scan_from, scan_of
from tests.synthetic_water import AT_REST, CAMERA, PLANNER, START_US, Bar, observe_from, odometry

SCANS = 14
NOW_US = START_US + (SCANS - 1) * SCAN_US
HERE = odometry(NOW_US, AT_REST)
AHEAD = GuidanceSetpoint(0.0, 0.6, escape_mps=0.6)


def met(hull: Bar, velocity_mps: tuple[float, float] = (0.0, 0.0), *, by_scanner: bool = True) -> PlannerState:
    """A boat at rest on open water that looks east. The hull is there by now, and has come with this velocity."""
    memory = ObservationMemory()
    for number in range(SCANS):
        ago_s = (SCANS - 1 - number) * SCAN_US * 1e-6
        east_m, north_m = -ago_s * velocity_mps[0], -ago_s * velocity_mps[1]
        bar = (hull[0] + east_m, hull[1] + north_m, hull[2] + east_m, hull[3] + north_m)
        memory = scan_from(START_US + number * SCAN_US, AT_REST, (bar,) if by_scanner else (), memory)
    return PlannerState(observe_from(memory=memory, at_us=NOW_US))


def planned(state: PlannerState, setpoint: GuidanceSetpoint = AHEAD) -> tuple[PlannerState, Plan]:
    return replan(state, HERE, setpoint, NOW_US, CAMERA, PLANNER)


BOAT_ASTERN = (-9.0, -0.8, -4.0, 0.8)


def test_the_boat_leaves_the_way_of_what_comes_from_astern() -> None:
    """At 1.2 m/s it would run over a boat at 0.6 m/s; unscanned, nothing is known of it."""
    _, unscanned = planned(met(BOAT_ASTERN, (1.2, 0.0), by_scanner=False))
    assert unscanned.heading_rad == pytest.approx(0.0, abs=0.01)
    _, plan = planned(met(BOAT_ASTERN, (1.2, 0.0)))
    assert abs(math.degrees(wrap_rad(plan.heading_rad))) > 20.0
    assert plan.speed_mps > 0.3


@pytest.mark.parametrize("aside", [1.0, -1.0])
def test_the_boat_keeps_off_what_lies_beside_it(aside: float) -> None:
    """A hull 1.3 m aside, in the blind zone, which counts as water; the course leads past its end with 0.3 m."""
    low_m, high_m = sorted((1.3 * aside, 3.0 * aside))
    course, hull = GuidanceSetpoint(aside * math.radians(30.0), 0.6, escape_mps=0.6), (-2.0, low_m, 1.8, high_m)
    assert aside * planned(met(hull, by_scanner=False), course)[1].heading_rad == pytest.approx(math.radians(30.0))
    assert aside * planned(met(hull), course)[1].heading_rad < math.radians(15.0)


def test_what_passes_at_a_distance_changes_nothing() -> None:
    state = met((-9.0, 7.0, -4.0, 9.0), (1.2, 0.0))
    assert planned(state)[1] == planned(met(BOAT_ASTERN, by_scanner=False))[1]


def test_the_reasons_are_told_from_what_was_recorded() -> None:
    """They are those of the scan that the plan was made on, though newer ones have come since."""
    state, _ = planned(met(BOAT_ASTERN, (1.2, 0.0)))
    reasons = explain_plan(state, CAMERA, PLANNER)
    assert any(each.costs.collision > 1.0 for each in reasons if isinstance(each.costs, m.HeadingCosts))
    newer = odometry(NOW_US + 100_000, AT_REST)
    later = observe(state, newer, None, PLANNER, scan=scan_of(NOW_US + 100_000, AT_REST, ()))
    assert later.memory.scans[-1] != state.memory.scans[-1]
    assert explain_plan(later, CAMERA, PLANNER) == reasons
    assert state.basis is not None
    assert explain_plan(replace(state, basis=replace(state.basis, scan_us=-1)), CAMERA, PLANNER) == ()


def test_people_are_shown_what_was_scanned_and_what_the_boat_does() -> None:
    state, plan = planned(met(BOAT_ASTERN, (1.2, 0.0)))
    order = m.NavCommand(source_us=NOW_US, enable=True, heading_rad=plan.heading_rad, speed_mps=plan.speed_mps)
    prediction = predict(NavigatorState(planner_state=state), order, HERE, None, NOW_US, CAMERA, NavigatorConfig())
    [vessel] = prediction.obstacles
    assert (vessel.is_scanned, vessel.mmsi, vessel.track_id) == (True, 0, 0)
    assert (vessel.east_mps, vessel.north_mps) == pytest.approx((1.2, 0.0), abs=0.15)
    assert prediction.courtesy == "Give way: something (lidar) overtaking us, moving aside"
