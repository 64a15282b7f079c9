"""The conversation with an autopilot: only the whole order of arming moves the boat, and everything else stops it."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from paani import messages as m
from paani.config import AdapterConfig
from paani.thrust_adapter import AppliedThrust, ThrustAdapter
from paani_services.thrusters.autopilot import MANUAL
from paani_services.thrusters.autopilot_output import operators_word
from paani_services.thrusters.autopilot_parameters import required_parameters
from paani_services.thrusters.autopilot_sticks import Sticks
from tests.rover_by_the_book import AHEAD, MIXER, PERIOD_MS, STICKS, STILL, RoverByTheBook

HOLD, RTL = 4, 11


@pytest.fixture
def rover() -> RoverByTheBook:
    return RoverByTheBook()


def test_it_drives_by_the_decision_of_the_thrust_adapter(rover: RoverByTheBook) -> None:
    rover.drive()
    rover.run(is_armed=True)
    assert set(rover.sticks) == {Sticks(300, 100)}
    assert rover.autopilot.zero_cause(rover.now_ms) is m.ZeroCause.NONE
    assert not rover.problem
    required = {requirement.names[0]: requirement.value for requirement in required_parameters(254)}
    assert rover.parameters == STICKS | required


def test_a_decision_of_zero_is_sent_as_zero(rover: RoverByTheBook) -> None:
    rover.drive()
    rover.run(is_armed=True, decided=AppliedThrust(0.0, 0.0, 0.0, 0.0, m.ZeroCause.TIMEOUT))
    assert set(rover.sticks) == {STILL}


@pytest.mark.parametrize("cause", [cause for cause in m.ZeroCause if cause is not m.ZeroCause.NONE])
def test_no_thrust_goes_out_beside_a_cause(rover: RoverByTheBook, cause: m.ZeroCause) -> None:
    rover.drive()
    rover.run(is_armed=True, decided=AHEAD._replace(zero_cause=cause))
    assert set(rover.sticks) == {STILL}


def test_the_operator_disarms_before_he_arms(rover: RoverByTheBook) -> None:
    """A process that begins while the operator is armed moves nothing."""
    rover.run(is_armed=None)
    rover.run(is_armed=True, seconds=8.0)
    assert not rover.arming
    assert not rover.sticks
    assert rover.autopilot.zero_cause(rover.now_ms) is m.ZeroCause.REARM


@pytest.mark.parametrize("value", [-1.0, 0.3, math.nan, math.inf])
@pytest.mark.parametrize("name", [requirement.names[0] for requirement in required_parameters(254)])
def test_a_parameter_that_reads_otherwise_refuses_to_arm(rover: RoverByTheBook, name: str, value: float) -> None:
    rover.stuck[name] = value
    rover.run(is_armed=False)
    rover.run(is_armed=True, seconds=9.0)
    assert not rover.arming
    assert set(rover.sticks) == {STILL}
    assert f"parameter {name} reads {value:g}" in rover.problem
    rover.stuck.clear()
    rover.run(is_armed=True, seconds=9.0)
    assert not rover.sent or not rover.sticks, "nothing arms by itself"
    rover.drive()


def test_a_parameter_that_is_not_answered_refuses_to_arm(rover: RoverByTheBook) -> None:
    del rover.parameters["FS_ACTION"]
    rover.run(is_armed=False)
    rover.run(is_armed=True, seconds=9.0)
    assert not rover.arming
    assert "FS_ACTION is not answered" in rover.problem


def test_parameters_are_read_anew_before_each_arming(rover: RoverByTheBook) -> None:
    rover.drive()
    rover.run(is_armed=False)
    rover.stuck["FS_ACTION"] = 0.0
    rover.run(is_armed=True, seconds=9.0)
    assert 1.0 not in rover.arming


def test_of_two_names_the_autopilots_own_counts(rover: RoverByTheBook) -> None:
    rover.parameters["MAV_GCS_SYSID"] = rover.parameters.pop("SYSID_MYGCS")
    rover.drive()


def test_it_is_set_to_manual_before_it_arms(rover: RoverByTheBook) -> None:
    rover.mode = HOLD
    rover.drive()
    assert rover.mode == MANUAL


def test_one_that_refuses_manual_is_not_armed(rover: RoverByTheBook) -> None:
    rover.mode, rover.refuses_mode = HOLD, True
    rover.run(is_armed=False)
    rover.run(is_armed=True, seconds=8.0)
    assert not rover.arming
    assert "its mode is HOLD, not MANUAL" in rover.problem


def _lose_heartbeat(rover: RoverByTheBook) -> None:
    rover.is_silent = True


def _change_mode(rover: RoverByTheBook) -> None:
    rover.mode = HOLD


def _disarm_it(rover: RoverByTheBook) -> None:
    rover.is_armed = False


def _exchange_it(rover: RoverByTheBook) -> None:
    rover.vehicle = (2, 3)


def _break_line(rover: RoverByTheBook) -> None:
    rover.autopilot.lose_line()


def _speak_again(rover: RoverByTheBook) -> None:
    rover.is_silent = False


def _do_nothing(_: RoverByTheBook) -> None:
    pass


ENDS = [
    (_lose_heartbeat, "no heartbeat"),
    (_change_mode, "its mode was changed to HOLD, not from here"),
    (_disarm_it, "it was disarmed, not from here"),
    (_exchange_it, "no ArduPilot Rover"),
    (_break_line, "line to the autopilot broke"),
]


@pytest.mark.parametrize(("end", "text"), ENDS)
def test_what_ends_a_drive_is_told_and_stays_ended(
    rover: RoverByTheBook, end: Callable[[RoverByTheBook], None], text: str
) -> None:
    rover.drive()
    end(rover)
    rover.run(is_armed=True, seconds=4.0)
    assert not rover.autopilot.is_driving
    assert text in rover.problem
    assert rover.problem.endswith("disarm and arm again")
    assert rover.autopilot.zero_cause(rover.now_ms) is not m.ZeroCause.NONE
    rover.is_silent, rover.mode, rover.vehicle = False, MANUAL, (11, 3)
    rover.run(is_armed=True, seconds=10.0)
    assert 1.0 not in rover.arming
    assert not set(rover.sticks) - {STILL}
    rover.run(is_armed=False)
    rover.drive()


def test_an_operators_word_that_is_too_old_is_no_word_and_ends_a_drive(rover: RoverByTheBook) -> None:
    config = AdapterConfig(require_pulses=())
    adapter = ThrustAdapter(config, domain=43)
    assert operators_word(adapter, adapter.decide(0)) is None
    adapter.receive_arming(m.Arming(source_us=0, armed=True), 0)
    lost_us = round(config.arming_timeout_s * 1e6) + 1
    assert operators_word(adapter, adapter.decide(lost_us - 1)) is True
    decided = adapter.decide(lost_us)
    assert operators_word(adapter, decided) is None
    rover.drive()
    rover.run(is_armed=operators_word(adapter, decided), decided=decided)
    assert "the operator's word is not known" in rover.problem
    rover.run(is_armed=True, seconds=4.0)
    assert not set(rover.sticks) - {STILL}


def test_nothing_is_sent_to_whoever_changed_the_mode(rover: RoverByTheBook) -> None:
    """Somebody else has the boat: neither sticks nor a disarming disturb him, until the operator says stop."""
    rover.drive()
    rover.mode = RTL
    rover.run(is_armed=True, seconds=2.0)
    rover.run(is_armed=True, seconds=5.0)
    assert not rover.sticks
    assert not rover.arming
    rover.run(is_armed=False)
    assert 0.0 in rover.arming


def test_a_silent_autopilot_is_told_to_stop_all_the_same(rover: RoverByTheBook) -> None:
    rover.drive()
    rover.is_silent = True
    rover.run(is_armed=True, seconds=3.0)
    rover.run(is_armed=True, seconds=2.0)
    assert set(rover.sticks) == {STILL}
    assert set(rover.arming) == {0.0}


def test_the_operators_stop_disarms_it(rover: RoverByTheBook) -> None:
    rover.drive()
    rover.run(is_armed=False)
    assert not rover.is_armed
    assert not set(rover.sticks) - {STILL}


def test_a_stop_while_it_arms_disarms_it(rover: RoverByTheBook) -> None:
    """The order to arm may be under way when the operator stops."""
    rover.run(is_armed=False)
    while not rover.arming:
        rover.run(is_armed=True, seconds=PERIOD_MS / 1000)
    rover.run(is_armed=False, seconds=4.0)
    assert not rover.is_armed
    assert 0.0 in rover.arming


def test_a_line_that_breaks_while_it_arms_latches(rover: RoverByTheBook) -> None:
    rover.run(is_armed=False)
    while not rover.arming:
        rover.run(is_armed=True, seconds=PERIOD_MS / 1000)
    rover.autopilot.lose_line()
    rover.run(is_armed=True, seconds=4.0)
    assert not rover.autopilot.is_driving
    assert "line to the autopilot broke" in rover.problem
    assert not rover.is_armed


def test_one_that_was_armed_by_somebody_else_is_left_alone(rover: RoverByTheBook) -> None:
    rover.is_armed = True
    rover.run(is_armed=False)
    rover.run(is_armed=True, seconds=8.0)
    assert not rover.arming
    assert not set(rover.sticks) - {STILL}
    assert "armed by somebody else" in rover.problem


@pytest.mark.parametrize("vehicle", [(2, 3), (11, 12), (10, 0)])
def test_only_a_rover_of_ardupilot_is_driven(rover: RoverByTheBook, vehicle: tuple[int, int]) -> None:
    rover.vehicle = vehicle
    rover.run(is_armed=False)
    rover.run(is_armed=True, seconds=8.0)
    assert not rover.arming
    assert "no ArduPilot Rover" in rover.problem


SIDE = st.floats(min_value=-1.0, max_value=1.0)


@example(words=[(False, 0, 1.0, 0.0, 0.0), (True, 0, 1.0, 0.0, 0.0), (None, 0, 1.0, 0.0, 1.0)])
@given(
    words=st.lists(
        st.tuples(
            st.sampled_from([None, False, True]),
            st.sampled_from([0, 1, 2, 3, 4, 5, 6]),
            st.floats(0.05, 3.0),
            SIDE,
            SIDE,
        ),
        max_size=12,
    )
)
@pytest.mark.slow
def test_whatever_happens_thrust_goes_only_to_one_that_was_armed_by_the_operator(
    words: list[tuple[bool | None, int, float, float, float]],
) -> None:
    """Any order of losses, of changes by others and of words: no stick but of the decision, none without the word."""
    rover = RoverByTheBook()
    acts: tuple[Callable[[RoverByTheBook], None], ...] = (_do_nothing, *(end for end, _ in ENDS), _speak_again)
    for is_armed, act, seconds, left, right in words:
        acts[act](rover)
        decided = AppliedThrust(left, right, left, right, m.ZeroCause.NONE)
        rover.run(is_armed, seconds, decided)
        moving = set(rover.sticks) - {STILL}
        assert not moving - {MIXER.mix(left, right).sticks}
        assert is_armed or not moving
