"""The conversation with an autopilot: only the whole order of arming moves the boat, and everything else stops it."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from paani import messages as m
from paani.thrust_adapter import AppliedThrust
from paani_services.thrusters.autopilot import (
    ARM,
    MANUAL,
    SET_MODE,
    STILL,
    Autopilot,
    Command,
    Heartbeat,
    Order,
    ReadParameter,
    Sticks,
    WriteParameter,
    required_parameters,
    sticks_of,
    thrust_of,
)

HOLD, RTL = 4, 11
AHEAD = AppliedThrust(0.4, 0.2, 30.0, 15.0, m.ZeroCause.NONE)
PERIOD_MS = 50


class Rover:
    """The far end by the book: what it is told it does, once a second it says how it is. `silent`: it says nothing."""

    def __init__(self) -> None:
        self.autopilot = Autopilot(254)
        self.parameters = {requirement.names[0]: 0.0 for requirement in required_parameters(254)}
        self.stuck: dict[str, float] = {}
        self.mode, self.is_armed, self.is_silent = MANUAL, False, False
        self.vehicle, self.refuses_mode = (11, 3), False
        self.now_ms = 0.0
        self.sent: list[Order] = []

    def run(self, is_armed: bool | None, seconds: float = 2.0, decided: AppliedThrust = AHEAD) -> list[Order]:
        """Go on for so long; what was sent meanwhile."""
        self.sent = []
        for _ in range(round(seconds * 1000 / PERIOD_MS)):
            self.now_ms += PERIOD_MS
            if self.now_ms % 1000 == 0 and not self.is_silent:
                self.autopilot.receive_heartbeat(Heartbeat(*self.vehicle, self.mode, self.is_armed), self.now_ms)
            orders = self.autopilot.advance(decided, is_armed, self.now_ms)
            self.sent += orders
            for order in orders:
                self.obey(order)
        return self.sent

    def obey(self, order: Order) -> None:
        match order:
            case Command(number, first, _) if number == ARM and not self.is_silent:
                self.is_armed = first == 1.0
            case Command(number, _, second) if number == SET_MODE and not self.refuses_mode:
                self.mode = int(second)
            case WriteParameter(name, value) if name in self.parameters:
                self.parameters[name] = value
            case ReadParameter(name) if name in self.parameters:
                self.autopilot.receive_parameter(name, self.stuck.get(name, self.parameters[name]))
            case _:
                pass

    def drive(self) -> None:
        self.run(is_armed=False)
        self.run(is_armed=True, seconds=4.0)
        assert self.autopilot.is_driving

    @property
    def sticks(self) -> list[Sticks]:
        return [order for order in self.sent if isinstance(order, Sticks)]

    @property
    def arming(self) -> list[float]:
        return [order.first for order in self.sent if isinstance(order, Command) and order.number == ARM]

    @property
    def problem(self) -> str:
        return self.autopilot.problem(self.now_ms)


@pytest.fixture
def rover() -> Rover:
    return Rover()


def test_it_drives_by_the_decision_of_the_thrust_adapter(rover: Rover) -> None:
    rover.drive()
    rover.run(is_armed=True)
    assert set(rover.sticks) == {Sticks(300, 100)}
    assert rover.autopilot.zero_cause(rover.now_ms) is m.ZeroCause.NONE
    assert not rover.problem
    assert rover.parameters == {requirement.names[0]: requirement.value for requirement in required_parameters(254)}


def test_a_decision_of_zero_is_sent_as_zero(rover: Rover) -> None:
    rover.drive()
    rover.run(is_armed=True, decided=AppliedThrust(0.0, 0.0, 0.0, 0.0, m.ZeroCause.TIMEOUT))
    assert set(rover.sticks) == {STILL}


@pytest.mark.parametrize("cause", [cause for cause in m.ZeroCause if cause is not m.ZeroCause.NONE])
def test_no_thrust_goes_out_beside_a_cause(rover: Rover, cause: m.ZeroCause) -> None:
    rover.drive()
    rover.run(is_armed=True, decided=AHEAD._replace(zero_cause=cause))
    assert set(rover.sticks) == {STILL}


def test_the_operator_disarms_before_he_arms(rover: Rover) -> None:
    """A process that begins while the operator is armed moves nothing."""
    rover.run(is_armed=None)
    rover.run(is_armed=True, seconds=8.0)
    assert not rover.arming
    assert not rover.sticks
    assert rover.autopilot.zero_cause(rover.now_ms) is m.ZeroCause.REARM


@pytest.mark.parametrize("value", [-1.0, 0.3, math.nan, math.inf])
@pytest.mark.parametrize("name", [requirement.names[0] for requirement in required_parameters(254)])
def test_a_parameter_that_reads_otherwise_refuses_to_arm(rover: Rover, name: str, value: float) -> None:
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


def test_a_parameter_that_is_not_answered_refuses_to_arm(rover: Rover) -> None:
    del rover.parameters["FS_ACTION"]
    rover.run(is_armed=False)
    rover.run(is_armed=True, seconds=9.0)
    assert not rover.arming
    assert "FS_ACTION is not answered" in rover.problem


def test_parameters_are_read_anew_before_each_arming(rover: Rover) -> None:
    rover.drive()
    rover.run(is_armed=False)
    rover.stuck["FS_ACTION"] = 0.0
    rover.run(is_armed=True, seconds=9.0)
    assert 1.0 not in rover.arming


def test_of_two_names_the_autopilots_own_counts(rover: Rover) -> None:
    rover.parameters["MAV_GCS_SYSID"] = rover.parameters.pop("SYSID_MYGCS")
    rover.drive()


def test_it_is_set_to_manual_before_it_arms(rover: Rover) -> None:
    rover.mode = HOLD
    rover.drive()
    assert rover.mode == MANUAL


def test_one_that_refuses_manual_is_not_armed(rover: Rover) -> None:
    rover.mode, rover.refuses_mode = HOLD, True
    rover.run(is_armed=False)
    rover.run(is_armed=True, seconds=8.0)
    assert not rover.arming
    assert "its mode is HOLD, not MANUAL" in rover.problem


def _lose_heartbeat(rover: Rover) -> None:
    rover.is_silent = True


def _change_mode(rover: Rover) -> None:
    rover.mode = HOLD


def _disarm_it(rover: Rover) -> None:
    rover.is_armed = False


def _exchange_it(rover: Rover) -> None:
    rover.vehicle = (2, 3)


def _break_line(rover: Rover) -> None:
    rover.autopilot.lose_line()


def _speak_again(rover: Rover) -> None:
    rover.is_silent = False


def _do_nothing(_: Rover) -> None:
    pass


ENDS = [
    (_lose_heartbeat, "no heartbeat"),
    (_change_mode, "its mode was changed to HOLD, not from here"),
    (_disarm_it, "it was disarmed, not from here"),
    (_exchange_it, "no ArduPilot Rover"),
    (_break_line, "line to the autopilot broke"),
]


@pytest.mark.parametrize(("end", "text"), ENDS)
def test_what_ends_a_drive_is_told_and_stays_ended(rover: Rover, end: Callable[[Rover], None], text: str) -> None:
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


def test_nothing_is_sent_to_whoever_changed_the_mode(rover: Rover) -> None:
    """Somebody else has the boat: neither sticks nor a disarming disturb him, until the operator says stop."""
    rover.drive()
    rover.mode = RTL
    rover.run(is_armed=True, seconds=2.0)
    rover.run(is_armed=True, seconds=5.0)
    assert not rover.sticks
    assert not rover.arming
    rover.run(is_armed=False)
    assert 0.0 in rover.arming


def test_a_silent_autopilot_is_told_to_stop_all_the_same(rover: Rover) -> None:
    rover.drive()
    rover.is_silent = True
    rover.run(is_armed=True, seconds=3.0)
    rover.run(is_armed=True, seconds=2.0)
    assert set(rover.sticks) == {STILL}
    assert set(rover.arming) == {0.0}


def test_the_operators_stop_disarms_it(rover: Rover) -> None:
    rover.drive()
    rover.run(is_armed=False)
    assert not rover.is_armed
    assert not set(rover.sticks) - {STILL}


def test_a_stop_while_it_arms_disarms_it(rover: Rover) -> None:
    """The order to arm may be under way when the operator stops."""
    rover.run(is_armed=False)
    while not rover.arming:
        rover.run(is_armed=True, seconds=PERIOD_MS / 1000)
    rover.run(is_armed=False, seconds=4.0)
    assert not rover.is_armed
    assert 0.0 in rover.arming


def test_one_that_was_armed_by_somebody_else_is_left_alone(rover: Rover) -> None:
    rover.is_armed = True
    rover.run(is_armed=False)
    rover.run(is_armed=True, seconds=8.0)
    assert not rover.arming
    assert not set(rover.sticks) - {STILL}
    assert "armed by somebody else" in rover.problem


def test_a_refusal_to_arm_is_told_in_its_words(rover: Rover) -> None:
    rover.run(is_armed=False)
    while not rover.arming:
        rover.run(is_armed=True, seconds=PERIOD_MS / 1000)
    rover.is_armed = False
    rover.autopilot.receive_text("PreArm: Compass not healthy")
    rover.autopilot.receive_refusal(ARM)
    assert rover.problem == "does not arm: PreArm: Compass not healthy; disarm and arm again"


@pytest.mark.parametrize("vehicle", [(2, 3), (11, 12), (10, 0)])
def test_only_a_rover_of_ardupilot_is_driven(rover: Rover, vehicle: tuple[int, int]) -> None:
    rover.vehicle = vehicle
    rover.run(is_armed=False)
    rover.run(is_armed=True, seconds=8.0)
    assert not rover.arming
    assert "no ArduPilot Rover" in rover.problem


SIDE = st.floats(min_value=-1.0, max_value=1.0)


@given(left=SIDE, right=SIDE)
def test_no_set_point_is_beyond_the_gates(left: float, right: float) -> None:
    sticks = sticks_of(left, right)
    assert all(-1000 <= stick <= 1000 for stick in sticks)
    for sent, decided in zip(thrust_of(sticks), (left, right), strict=True):
        assert abs(sent) <= abs(decided) + 1e-12
        assert abs(sent - decided) < 0.002 + 1e-12
        assert sent * decided >= 0.0


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
def test_whatever_happens_thrust_goes_only_to_one_that_was_armed_by_the_operator(
    words: list[tuple[bool | None, int, float, float, float]],
) -> None:
    """Any order of losses, of changes by others and of words: no stick but of the decision, none without the word."""
    rover = Rover()
    acts: tuple[Callable[[Rover], None], ...] = (_do_nothing, *(end for end, _ in ENDS), _speak_again)
    for is_armed, act, seconds, left, right in words:
        acts[act](rover)
        decided = AppliedThrust(left, right, left, right, m.ZeroCause.NONE)
        rover.run(is_armed, seconds, decided)
        moving = set(rover.sticks) - {STILL}
        assert not moving - {sticks_of(left, right)}
        assert is_armed or not moving
