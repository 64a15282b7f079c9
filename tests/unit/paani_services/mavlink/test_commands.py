"""Commands: what arms, what stops, what is refused and why."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from paani import messages as m
from paani_services.mavlink import commands
from paani_services.mavlink.commands import Act, Verdict, arm_result, judge_command, mode_result, stop_result
from tests.mavlink_peer import NOW_US, armed, in_order

NAN = math.nan
COMMANDS = st.sampled_from([16, 17, 20, 176, 178, 185, 192, 193, 224, 300]) | st.integers(0, 65_535)
ANY = st.floats() | st.integers(-10, 3000).map(float)


def judge(command: int, *parameters: float, trusted: bool = True, snapshot: object = None) -> Verdict:
    given_parameters = [*parameters, *[NAN] * (7 - len(parameters))]
    return judge_command(command, given_parameters, snapshot or in_order(), is_trusted=trusted)  # type: ignore[arg-type]


def test_arming_is_asked_of_the_operators_process() -> None:
    assert judge(commands.ARM_DISARM, 1.0).act is Act.ARM
    assert judge(commands.ARM_DISARM, 1.0, 0.0).act is Act.ARM
    assert judge(commands.ARM_DISARM, 1.0, snapshot=armed()) == Verdict(commands.ACCEPTED)


@pytest.mark.parametrize("force", [21_196.0, 2989.0, 1.0])
def test_arming_cannot_be_forced(force: float) -> None:
    verdict = judge(commands.ARM_DISARM, 1.0, force)
    assert (verdict.result, verdict.act) == (commands.DENIED, None)


@pytest.mark.parametrize("force", [0.0, NAN, 21_196.0])
def test_disarming_is_a_stop_forced_or_not(force: float) -> None:
    """Whatever is known of the boat."""
    for snapshot in (in_order(), armed(), in_order(operator=None, command=None, applied=None)):
        assert judge(commands.ARM_DISARM, 0.0, force, snapshot=snapshot).act is Act.STOP
    assert judge(commands.TERMINATE, 1.0).act is Act.STOP


@pytest.mark.parametrize("number", [NAN, math.inf, -1.0, 2.0, 0.5])
def test_arming_by_a_number_that_is_neither_is_refused(number: float) -> None:
    verdict = judge(commands.ARM_DISARM, number)
    assert (verdict.result, verdict.act) == (commands.DENIED, None)


@pytest.mark.parametrize(
    ("snapshot", "text"),
    [
        (in_order(operator=None), "operator silent"),
        (in_order(command=None), "navigator silent"),
        (in_order(applied=None), "thrust adapter silent"),
        (
            in_order(
                command=m.NavCommand(
                    source_us=NOW_US, enable=False, heading_rad=0.0, speed_mps=0.0,
                    inhibits=(m.Inhibit.NOT_ARMED, m.Inhibit.UNHEALTHY_ODOMETRY),
                )
            ),
            "unhealthy odometry",
        ),
    ],
)  # fmt: skip
def test_a_boat_that_is_not_in_order_is_not_armed(snapshot: object, text: str) -> None:
    verdict = judge(commands.ARM_DISARM, 1.0, snapshot=snapshot)
    assert (verdict.result, verdict.act) == (commands.FAILED, None)
    assert text in verdict.text


@pytest.mark.parametrize(
    ("command", "parameters"),
    [(400, (1.0,)), (400, (0.0,)), (185, (1.0,)), (176, (1.0, 4.0)), (20, ()), (17, ()), (300, ()), (193, (0.0,))],
)
def test_nobody_who_is_not_trusted_asks_for_anything(command: int, parameters: tuple[float, ...]) -> None:
    assert judge(command, *parameters).act is not None
    assert judge(command, *parameters, trusted=False) == Verdict(commands.DENIED, commands.NOT_TRUSTED)


@given(COMMANDS.filter(lambda number: number != commands.ARM_DISARM), st.lists(ANY, min_size=7, max_size=7))
@pytest.mark.slow
def test_nothing_but_the_command_that_arms_arms(command: int, parameters: list[float]) -> None:
    assert judge(command, *parameters).act is not Act.ARM


@pytest.mark.parametrize("command", [21, 22, 246, 31_000, 65_535])
def test_an_unknown_command_is_not_supported(command: int) -> None:
    assert judge(command, 1.0) == Verdict(commands.UNSUPPORTED)


@pytest.mark.parametrize(
    ("number", "mode"),
    [
        (0.0, m.DriveMode.MANUAL),
        (4.0, m.DriveMode.IDLE),
        (5.0, m.DriveMode.HOLD),
        (10.0, m.DriveMode.ROUTE),
        (11.0, m.DriveMode.RETURN),
    ],
)
def test_a_mode_is_asked_of_the_operators_process(number: float, mode: m.DriveMode) -> None:
    """base mode 129 is what MAVSDK sends with every mode: its bit of arming is not heard."""
    verdict = judge(commands.SET_MODE, 129.0, number)
    assert (verdict.act, verdict.mode) == (Act.MODE, mode)


@pytest.mark.parametrize("number", [NAN, 1.0, 15.0, -1.0, 4.5])
def test_a_mode_that_the_boat_has_not_is_refused(number: float) -> None:
    verdict = judge(commands.SET_MODE, 1.0, number)
    assert (verdict.result, verdict.act) == (commands.DENIED, None)


@pytest.mark.parametrize(
    ("command", "first", "mode"),
    [
        (20, 0.0, m.DriveMode.RETURN),
        (300, 0.0, m.DriveMode.ROUTE),
        (17, 0.0, m.DriveMode.HOLD),
        (193, 0.0, m.DriveMode.HOLD),
        (193, 1.0, m.DriveMode.ROUTE),
    ],
)
def test_commands_that_stand_for_a_mode(command: int, first: float, mode: m.DriveMode) -> None:
    verdict = judge(command, first)
    assert (verdict.act, verdict.mode) == (Act.MODE, mode)


@pytest.mark.parametrize("command", [16, 178, 179, 192, 194, 207])
def test_the_boat_is_not_guided_from_here(command: int) -> None:
    assert judge(command, 1.0)[:2] == (commands.DENIED, "refused: the boat follows its own mission")


@pytest.mark.parametrize("refusal", [None, *m.ModeRefusal])
def test_every_answer_about_a_mode_has_a_result(refusal: m.ModeRefusal | None) -> None:
    result, text = mode_result(refusal)
    assert (result == commands.ACCEPTED) is (refusal is m.ModeRefusal.NONE) is (text == "")
    assert len(text) <= 50


@pytest.mark.parametrize("refusal", [None, *m.ArmRefusal])
def test_every_answer_of_the_operator_has_a_result(refusal: m.ArmRefusal | None) -> None:
    result, text = arm_result(refusal)
    assert (result == commands.ACCEPTED) is (refusal is m.ArmRefusal.NONE) is (text == "")
    assert len(text) <= 50


def test_a_stop_is_done_when_it_is_latched() -> None:
    assert stop_result(None)[0] == commands.FAILED
    assert stop_result(m.OperatorState(source_us=0, armed=False, stopped=True)) == (commands.ACCEPTED, "")
