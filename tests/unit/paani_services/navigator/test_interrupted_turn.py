"""A turn out of the picture goes on, on the spot, where that picture stops the boat."""

import math

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paani.config import load_config
from paani.geometry import wrap_rad
from paani.messages import Direction, Inhibit, NavCommand, Odometry, Reason
from paani.motion_planning import HeadingSpeed
from paani_services.navigator.avoidance.constraints import HALF_FIELD_OF_VIEW_RAD
from paani_services.navigator.guidance.station_keeping import Station, hold_station
from paani_services.navigator.guidance.visual_turns import ON_HEADING_RAD
from paani_services.navigator.navigate import NavigatorState, navigate
from tests.synthetic_water import CAMERA
from tests.unit.paani_services.navigator.test_interlocks import MISSION
from tests.unit.paani_services.navigator.test_navigate import NOW_US, RUNNING, advice, inputs, pose

NAVIGATOR = load_config().navigator
STEP_US = 100_000
REPLAN_US = round(NAVIGATOR.planner.replan_s * 1e6)
TURN_RADPS, DRIFT_MPS = 0.35, 0.1
ANGLE = st.floats(-math.pi, math.pi)


class Drive:
    """Calls `navigate` with a planner that always gives the same plan."""

    def __init__(self, plan: HeadingSpeed) -> None:
        self.plan, self.state, self.now_us = plan, RUNNING, NOW_US

    def order(self, direction: Direction, at: Odometry, after_us: int = STEP_US, *, may: bool = True) -> NavCommand:
        self.now_us += after_us
        advisory = advice(direction, self.now_us)
        if direction is Direction.STOP:
            advisory = msgspec.structs.replace(advisory, reason=Reason.NO_SAFE_SIDE, may_keep_station=may)
        given_inputs = inputs(
            self.now_us, advisory=advisory, odometry=msgspec.structs.replace(at, source_us=self.now_us)
        )
        self.state, order = navigate(
            self.state, given_inputs, MISSION, self.now_us, 43, NAVIGATOR, CAMERA, lambda _: self.plan
        )
        return order


def adrift(yaw_rad: float) -> Odometry:
    """A boat with its bow there that is carried along the map's first axis."""
    return msgspec.structs.replace(
        pose(3.0, 0.0, yaw_rad), surge_mps=DRIFT_MPS * math.cos(yaw_rad), sway_mps=-DRIFT_MPS * math.sin(yaw_rad)
    )


def station_of(state: NavigatorState) -> Station:
    assert state.station is not None
    return state.station


@given(ANGLE, ANGLE, st.sampled_from([0.03, 0.15, 0.6]))
def test_the_bow_goes_on_to_what_it_does_not_see_and_to_nothing_that_it_sees(
    heading_rad: float, yaw_rad: float, speed_mps: float
) -> None:
    drive, at = Drive(HeadingSpeed(heading_rad, speed_mps)), adrift(yaw_rad)
    drive.order(Direction.LEFT, at)
    order, station = drive.order(Direction.STOP, at), station_of(drive.state)
    is_unseen = abs(wrap_rad(heading_rad - yaw_rad)) > HALF_FIELD_OF_VIEW_RAD
    assert station.turn_rad == (heading_rad if is_unseen else None)
    without = hold_station(msgspec.structs.replace(station, turn_rad=None), (station.x_m, station.y_m), at)
    assert order.heading_rad == pytest.approx(heading_rad if is_unseen else without.heading_rad)
    assert (order.keeps_station, order.speed_mps, order.vetoes) == (True, 0.0, (Inhibit.ADVISED_STOP,))
    assert order.astern_mps == pytest.approx(without.astern_mps), "a turn changes nothing of the way astern"


@pytest.mark.parametrize(
    ("plan", "after_us", "may", "goes_on"),
    [
        (HeadingSpeed(2.0, 0.03), STEP_US, True, True),
        (HeadingSpeed(2.0, 0.03), REPLAN_US + 1, True, False),  # a plan of an earlier time
        (HeadingSpeed(2.0, 0.0), STEP_US, True, False),  # no way was free
        (HeadingSpeed(2.0, 0.03), STEP_US, False, False),  # somebody may be at the fans
    ],
)
def test_a_turn_goes_on_where_its_plan_was_in_force_and_thrust_is_allowed(
    plan: HeadingSpeed, after_us: int, may: bool, goes_on: bool
) -> None:
    drive = Drive(plan)
    drive.order(Direction.LEFT, adrift(0.0))
    order = drive.order(Direction.STOP, adrift(0.0), after_us, may=may)
    assert (order.enable and order.heading_rad == pytest.approx(2.0)) == goes_on
    assert order.enable == may


def test_a_turn_that_was_finished_is_not_begun_again_and_a_later_one_is_another() -> None:
    drive = Drive(HeadingSpeed(2.0, 0.03))
    drive.order(Direction.LEFT, adrift(0.0))
    on_heading_rad = 2.0 - 0.9 * ON_HEADING_RAD
    for yaw_rad, expected in ((0.0, 2.0), (1.0, 2.0), (1.9, 2.0), (on_heading_rad, None), (0.5, None)):
        drive.order(Direction.STOP, adrift(yaw_rad))
        assert station_of(drive.state).turn_rad == expected
    drive.plan = HeadingSpeed(-2.0, 0.03)
    drive.order(Direction.RIGHT, adrift(0.5))
    drive.order(Direction.STOP, adrift(0.5))
    assert station_of(drive.state).turn_rad == -2.0


@given(st.floats(1.5, 2.8), st.sampled_from([-1, 1]), st.floats(0.1, 0.5), st.floats(0.1, 2.8))
def test_pictures_that_stop_a_turn_half_way_do_not_keep_the_boat_from_making_it(
    turn_rad: float, side: int, from_rad: float, width_rad: float
) -> None:
    """Where the advice stops the boat in some headings, and wind carries it to where it faced at first."""
    drive, yaw_rad, least_rad = Drive(HeadingSpeed(side * turn_rad, 0.03)), 0.0, math.pi
    step_rad = TURN_RADPS * STEP_US * 1e-6
    for _ in range(math.ceil(turn_rad / step_rad) + 1):
        is_stopped = from_rad <= abs(yaw_rad) <= from_rad + width_rad
        order = drive.order(Direction.STOP if is_stopped else Direction.LEFT, adrift(yaw_rad))
        yaw_rad += max(-step_rad, min(step_rad, wrap_rad(order.heading_rad - yaw_rad)))
        least_rad = min(least_rad, abs(wrap_rad(side * turn_rad - yaw_rad)))
    assert least_rad <= ON_HEADING_RAD
