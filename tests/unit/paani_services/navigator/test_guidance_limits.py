"""What guidance does for every turn and from every side of a waypoint, in both profiles (M1, M4, M10)."""

from __future__ import annotations

import math

import pytest

from paani.config import NavigatorConfig
from paani.messages import Direction
from tests.unit.paani_services.navigator.test_navigate import (
    NOW_US,
    PAANI,
    PAPER,
    GuidanceRun,
    advice,
    inputs,
    pose,
    run,
)

BOTH = pytest.mark.parametrize("config", [PAANI, PAPER], ids=["paani", "paper"])
TURNS = (Direction.LEFT, Direction.RIGHT, Direction.SLIGHT_LEFT, Direction.SLIGHT_RIGHT)


@BOTH
@pytest.mark.parametrize("direction", TURNS)
def test_m1_no_turn_changes_the_waypoint_and_straight_on_does(config: NavigatorConfig, direction: Direction) -> None:
    guidance = GuidanceRun(config)
    targets = [guidance.order(each, pose(10.0, 0.0)).waypoint_index for each in (direction, Direction.STOP)]
    assert targets == [1, 1]
    assert guidance.order(Direction.STRAIGHT, pose(10.0, 0.0)).waypoint_index == 2


@pytest.mark.parametrize(("x_m", "y_m"), [(3.0, -2.0), (17.0, -2.0), (17.0, 3.0)])
def test_m4_the_course_is_the_bearing_of_a_waypoint_on_any_side(x_m: float, y_m: float) -> None:
    _, order = run(PAPER, inputs(odometry=pose(x_m, y_m)))
    assert order.heading_rad == pytest.approx(math.atan2(-y_m, 10.0 - x_m))


@BOTH
def test_m10_advice_of_three_and_a_half_seconds_is_followed(config: NavigatorConfig) -> None:
    assert run(config, inputs(advisory=advice(Direction.STRAIGHT, NOW_US - 3_500_000)))[1].enable
