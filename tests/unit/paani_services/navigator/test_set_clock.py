"""A clock that is set back by any time keeps the boat from moving no longer than a start would."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paani import messages as m
from paani.missions import mission_of_route
from paani_services.navigator.interlocks import NavigatorInputs
from paani_services.navigator.modes import follow_order
from paani_services.navigator.navigate import NavigatorState
from tests.synthetic_water import AT_REST, CAMERA, CONFIG, START_US, evidence, odometry, water_edge_of

PERIOD_US = 200_000
ORIGIN_US = 4 * 3600 * 1_000_000  # later than any clock is set back here
EAST = (m.Waypoint(x_m=20.0, y_m=0.0), m.Waypoint(x_m=40.0, y_m=0.0))
MISSION = mission_of_route(m.Route(source_us=0, name="east", waypoints=EAST))
OPEN, ENCLOSED = water_edge_of(AT_REST), water_edge_of(AT_REST, bank_m=1.0)


class Watch:
    """A navigator at rest, five pictures a second. `stamp_ahead_us`: how far odometry is dated ahead of its clock."""

    def __init__(self) -> None:
        self.state, self.steps, self.set_by_us, self.epoch = NavigatorState(), 0, 0, 2

    def step(self, water_edge: tuple[float, ...], stamp_ahead_us: int = 0) -> m.NavCommand:
        self.steps += 1
        now_us = ORIGIN_US + START_US + self.steps * PERIOD_US + self.set_by_us
        moved = odometry(now_us + stamp_ahead_us, AT_REST, epoch=self.epoch)
        heard = NavigatorInputs(
            advisory=m.Advisory(source_us=now_us, direction=m.Direction.STRAIGHT, reason=m.Reason.CENTER_CLEAR),
            advisory_us=now_us,
            odometry=moved,
            odometry_us=now_us,
            clock=m.SimTime(source_us=now_us, sim_us=self.steps * PERIOD_US, stamp_us=1),
            clock_us=now_us,
            arming=m.Arming(source_us=now_us, armed=True),
            arming_us=now_us,
            evidence=evidence(now_us, water_edge, frame_seq=self.steps),
        )
        config = CONFIG.navigator
        self.state, command = follow_order(self.state, heard, MISSION, now_us, 43, config, CAMERA)
        return command

    def set_back(self, by_us: int) -> None:
        self.set_by_us -= by_us
        self.epoch -= 1


@settings(max_examples=6, deadline=None)
@given(st.integers(1_000_000, 3 * 3600 * 1_000_000), st.booleans(), st.integers(0, 2))
@pytest.mark.slow
def test_the_boat_goes_on_after_its_clock_was_set_back(by_us: int, was_enclosed: bool, dated_before: int) -> None:
    """Whether it had a way before or not, and whatever was still dated by the clock of before."""
    watch = Watch()
    before = [watch.step(ENCLOSED if was_enclosed else OPEN) for _ in range(5)]
    assert (before[-1].speed_mps == 0.0) is was_enclosed
    watch.set_back(by_us)
    for _ in range(dated_before):
        assert not watch.step(OPEN, stamp_ahead_us=by_us).enable
    after = [watch.step(OPEN) for _ in range(8)]
    assert after[-1].enable, after[-1].halt_reasons
    assert after[-1].speed_mps > 0.0


def test_odometry_of_the_clock_of_before_guides_nobody() -> None:
    """The planner's memory begins anew with the first odometry of the clock as it is set."""
    watch = Watch()
    for _ in range(5):
        watch.step(OPEN)
    watch.set_back(3_600_000_000)
    watch.step(OPEN, stamp_ahead_us=3_600_000_000)
    watch.step(OPEN)
    here = watch.state.planner_state.memory
    assert here.odom_pose is not None
    assert here.odom_pose.stamp_us == ORIGIN_US + START_US + watch.steps * PERIOD_US + watch.set_by_us
    assert all(each.stamp_us <= here.odom_pose.stamp_us for each in here.observations)
