"""Before an autopilot is armed: what its parameters say of its sticks, and why it refuses."""

from __future__ import annotations

import math

import pytest

from paani import messages as m
from paani.thrust_adapter import AppliedThrust
from paani_services.thrusters.autopilot import ARM
from paani_services.thrusters.autopilot_sticks import Channel, StickMixer
from tests.rover_by_the_book import AHEAD, PERIOD_MS, ROUND, STICKS, STILL, RoverByTheBook


@pytest.fixture
def rover() -> RoverByTheBook:
    return RoverByTheBook()


def _refuse(rover: RoverByTheBook) -> None:
    """As ArduPilot does it: the refusal first, and then a line for each of its checks that failed."""
    rover.run(is_armed=False)
    while not rover.arming:
        rover.run(is_armed=True, seconds=PERIOD_MS / 1000)
    rover.is_armed = False
    rover.autopilot.receive_refusal(ARM, rover.now_ms)


def test_a_refusal_to_arm_is_told_in_its_words(rover: RoverByTheBook) -> None:
    _refuse(rover)
    rover.run(is_armed=True, seconds=0.2)
    for text in (
        "EKF3 IMU0 initialised",
        "Arm: Compass not healthy",
        "Arm: Compass not healthy",
        "Arm: GPS 1: bad fix",
    ):
        rover.autopilot.receive_text(text)
    rover.run(is_armed=True, seconds=0.6)
    assert rover.problem == "does not arm: Arm: Compass not healthy; Arm: GPS 1: bad fix; disarm and arm again"
    assert not rover.is_armed


def test_one_that_has_refused_is_not_told_to_arm_again(rover: RoverByTheBook) -> None:
    _refuse(rover)
    rover.run(is_armed=True, seconds=6.0)
    assert 1.0 not in rover.arming
    assert rover.problem == "does not arm: without a reason; disarm and arm again"
    rover.drive()


def test_no_more_than_three_reasons_are_told(rover: RoverByTheBook) -> None:
    _refuse(rover)
    for number in range(9):
        rover.autopilot.receive_text(f"PreArm: check {number}")
    rover.run(is_armed=True, seconds=1.0)
    assert rover.problem == ("does not arm: PreArm: check 0; PreArm: check 1; PreArm: check 2; disarm and arm again")


@pytest.mark.parametrize(
    ("name", "value", "text"),
    [
        ("RC_OPTIONS", 34.0, "ignores our sticks"),
        ("RC_OPTIONS", math.nan, "RC_OPTIONS reads nan"),
        ("MOT_THR_MAX", 0.0, "MOT_THR_MAX reads 0"),
        ("MOT_THR_MAX", math.inf, "MOT_THR_MAX reads inf"),
        ("RCMAP_THROTTLE", 0.0, "RCMAP_THROTTLE reads 0"),
        ("RCMAP_THROTTLE", math.nan, "RCMAP_THROTTLE reads nan"),
        ("RCMAP_ROLL", 17.0, "RCMAP_ROLL reads 17"),
        ("RCMAP_ROLL", 3.0, "read the same, 3"),
        ("RC3_TRIM", 1000.0, "parameters RC3_MIN, TRIM, MAX and DZ"),
        ("RC1_MAX", math.nan, "RC1_MAX reads nan"),
        ("RC1_DZ", 450.0, "parameters RC1_MIN, TRIM, MAX and DZ"),
        ("RC1_REVERSED", math.inf, "RC1_REVERSED reads inf"),
        ("SERVO2_FUNCTION", 26.0, "none reads 73, thrust of the left side"),
        ("SERVO16_FUNCTION", 70.0, "none reads 74, thrust of the right side"),
        ("SERVO16_FUNCTION", math.nan, "none reads 74, thrust of the right side"),
    ],
)
def test_sticks_by_which_nothing_can_be_said_refuse_to_arm(
    rover: RoverByTheBook, name: str, value: float, text: str
) -> None:
    rover.parameters[name] = value
    rover.run(is_armed=False)
    rover.run(is_armed=True, seconds=9.0)
    assert not rover.arming
    assert text in rover.problem
    assert rover.parameters[name] == value or math.isnan(value), "the calibration of a receiver is not ours to write"


@pytest.mark.parametrize("name", [name for name in sorted(STICKS) if "SERVO" not in name])
def test_sticks_that_are_not_known_refuse_to_arm(rover: RoverByTheBook, name: str) -> None:
    del rover.parameters[name]
    rover.run(is_armed=False)
    rover.run(is_armed=True, seconds=9.0)
    assert not rover.arming
    assert f"parameter {name} is not answered" in rover.problem


def test_sticks_are_those_of_the_autopilots_own_channels(rover: RoverByTheBook) -> None:
    """Other channels, a rest that is not in the middle, a dead zone, and an axis the other way."""
    rover.parameters |= {"RCMAP_THROTTLE": 2.0, "RCMAP_ROLL": 4.0}
    rover.parameters |= {"RC2_MIN": 1100, "RC2_MAX": 1900, "RC2_TRIM": 1480, "RC2_DZ": 30, "RC2_REVERSED": 1}
    rover.parameters |= {"RC4_MIN": 1000, "RC4_MAX": 2000, "RC4_TRIM": 1500, "RC4_DZ": 0, "RC4_REVERSED": 0}
    mixer = StickMixer(Channel(1100, 1900, 1480, 30, True), ROUND)
    rover.drive()
    rover.run(is_armed=True)
    assert set(rover.sticks) == {mixer.mix(AHEAD.left, AHEAD.right).sticks}
    rover.run(is_armed=True, decided=AppliedThrust(0.0, 0.0, 0.0, 0.0, m.ZeroCause.TIMEOUT))
    assert set(rover.sticks) == {mixer.still.sticks} != {STILL}
    rover.run(is_armed=False)
    assert set(rover.sticks) <= {mixer.still.sticks}


def test_what_is_read_and_written_within_its_time_is_no_problem(rover: RoverByTheBook) -> None:
    rover.run(is_armed=False)
    rover.stuck["FS_ACTION"] = 0.0
    rover.run(is_armed=True, seconds=1.5)
    assert not rover.problem
    rover.run(is_armed=True, seconds=1.5)
    assert "FS_ACTION reads 0, expected 2" in rover.problem
