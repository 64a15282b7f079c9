"""What goes to the microcontroller, and what is known to come out of it."""

from __future__ import annotations

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paani import messages as m
from paani.config import EscConfig, ThrustersConfig, load_config
from paani.errors import UserError
from paani.microcontroller.caller import McuCaller
from paani.microcontroller.payloads import THRUST, McuStatus
from paani.thrust_adapter import AppliedThrust
from paani_services.thrusters.output import (
    OutputTracker,
    ReportSchedule,
    esc_settings,
    find_output_cause,
    holds_of,
    thrust_call,
)
from paani_services.thrusters.state import Sent, note_of, thrusters_state

AHEAD = AppliedThrust(0.2, 0.3, 15.0, 22.5, m.ZeroCause.NONE)
DISARMED = AppliedThrust(0.0, 0.0, 0.0, 0.0, m.ZeroCause.NOT_ARMED)
LIVE = McuStatus(kind=THRUST, state=m.McuState.FRESH, verdict=m.McuVerdict.ACCEPTED, enabled=True)
LEASE_MS = 300.0


def accept(output: OutputTracker, decided: AppliedThrust, now_ms: float) -> None:
    """A frame of this decision that is answered at once."""
    output.send(decided, now_ms)
    output.accept(now_ms)


def test_a_frame_carries_the_decision_and_its_lease() -> None:
    call = thrust_call(AHEAD, True, (7, 42), 300)
    assert (call.armed, call.session, call.seq, call.lease_ms, call.age_ms) == (True, 7, 42, 300, 0)
    assert (call.left, call.right) == (0.2, 0.3)


def test_a_boat_that_is_not_armed_is_sent_zero() -> None:
    call = thrust_call(AHEAD, False, (7, 42), 300)
    assert (call.armed, call.left, call.right) == (False, 0.0, 0.0)


def test_both_sides_are_driven_as_they_were_calibrated() -> None:
    settings = ThrustersConfig(
        slew_per_s=1.5, min_battery_v=11.1, max_current_a=20.0,
        left=EscConfig(reversed=True, trim_us=-12, deadband_us=30), right=EscConfig(trim_us=8, deadband_us=25),
    )  # fmt: skip
    esc = esc_settings(settings, 9)
    assert (esc.session, esc.left_reversed, esc.right_reversed) == (9, True, False)
    assert (esc.trim_left_us, esc.trim_right_us, esc.deadband_left_us, esc.deadband_right_us) == (-12, 8, 30, 25)
    assert (esc.neutral_us, esc.span_us, esc.slew_per_s) == (1500, 400, 1.5)
    assert (esc.min_battery_v, esc.max_current_a) == (11.1, 20.0)
    esc.encode()


@pytest.mark.parametrize(
    ("holds", "cause"),
    [
        (1, m.ZeroCause.EMERGENCY_STOP),
        (2, m.ZeroCause.RECEIVER),
        (4, m.ZeroCause.BATTERY_LOW),
        (8, m.ZeroCause.OVER_CURRENT),
        (16, m.ZeroCause.REARM),
        (31, m.ZeroCause.EMERGENCY_STOP),
    ],
)
def test_a_hold_of_the_microcontroller_is_the_cause(holds: int, cause: m.ZeroCause) -> None:
    status = msgspec.structs.replace(LIVE, holds=holds)
    assert find_output_cause(status, 10.0, LEASE_MS) is cause
    assert len(holds_of(status)) == holds.bit_count()
    assert OutputTracker(LEASE_MS).applied(AHEAD, cause, 0.0) == (0.0, 0.0, 0.0, 0.0, cause, "")


def test_what_does_not_answer_or_does_not_take_thrust_gives_none() -> None:
    assert find_output_cause(LIVE, 10.0, LEASE_MS) is m.ZeroCause.NONE
    assert find_output_cause(None, 10.0, LEASE_MS) is m.ZeroCause.LINE_LOST
    assert find_output_cause(LIVE, LEASE_MS + 1, LEASE_MS) is m.ZeroCause.LINE_LOST
    for state in (m.McuState.BOOT, m.McuState.STALE, m.McuState.SAFE):
        status = msgspec.structs.replace(LIVE, state=state)
        assert find_output_cause(status, 10.0, LEASE_MS) is m.ZeroCause.REFUSED
    for verdict in set(m.McuVerdict) - {m.McuVerdict.ACCEPTED, m.McuVerdict.NONE}:
        status = msgspec.structs.replace(LIVE, verdict=verdict)
        assert find_output_cause(status, 10.0, LEASE_MS) is m.ZeroCause.REFUSED


def test_a_zero_is_applied_when_it_was_answered_or_the_lease_is_over() -> None:
    """The operator's STOP is confirmed by what the microcontroller does, not by what it was told."""
    output = OutputTracker(LEASE_MS)
    assert output.applied(AHEAD, m.ZeroCause.NONE, 0.0).zero_cause is m.ZeroCause.LINE_LOST
    accept(output, AHEAD, 1000.0)
    assert output.applied(DISARMED, m.ZeroCause.NONE, 1100.0) == AHEAD
    assert output.applied(DISARMED, m.ZeroCause.LINE_LOST, 1000.0 + LEASE_MS) == AHEAD
    assert output.applied(DISARMED, m.ZeroCause.REFUSED, 1000.0 + LEASE_MS) == AHEAD, "refused: the last one runs on"
    assert output.applied(AHEAD, m.ZeroCause.REFUSED, 1001.0 + LEASE_MS).zero_cause is m.ZeroCause.REFUSED
    assert output.applied(DISARMED, m.ZeroCause.LINE_LOST, 1001.0 + LEASE_MS) == DISARMED
    assert output.applied(AHEAD, m.ZeroCause.LINE_LOST, 1001.0 + LEASE_MS).zero_cause is m.ZeroCause.LINE_LOST
    accept(output, DISARMED, 1100.0)
    assert output.applied(DISARMED, m.ZeroCause.NONE, 1101.0) == DISARMED


def test_a_frame_without_an_answer_may_have_arrived() -> None:
    """A zero is not confirmed before its lease is over as well, or a later frame was answered."""
    output = OutputTracker(LEASE_MS)
    accept(output, AHEAD, 0.0)
    output.send(AHEAD, 40.0)
    output.lose(290.0)
    output.send(DISARMED, 400.0)
    output.lose(650.0)
    assert output.applied(DISARMED, m.ZeroCause.NONE, 290.0 + LEASE_MS) == AHEAD
    assert output.applied(DISARMED, m.ZeroCause.LINE_LOST, 291.0 + LEASE_MS) == DISARMED
    assert output.applied(AHEAD, m.ZeroCause.LINE_LOST, 301.0).zero_cause is m.ZeroCause.LINE_LOST
    output.send(AHEAD, 700.0)
    assert output.applied(DISARMED, m.ZeroCause.NONE, 701.0) == AHEAD, "on its way"
    output.refuse()
    assert output.applied(DISARMED, m.ZeroCause.REFUSED, 702.0) == DISARMED
    output.send(AHEAD, 800.0)
    output.lose(1050.0)
    accept(output, DISARMED, 1060.0)
    assert output.applied(DISARMED, m.ZeroCause.NONE, 1061.0) == DISARMED


STEP_MS = st.floats(1.0, 250.0)
FRAMES = st.lists(st.tuples(st.sampled_from([AHEAD, DISARMED]), st.sampled_from(["accept", "refuse", "lose"]), STEP_MS))


@given(FRAMES)
def test_no_zero_is_applied_while_a_frame_that_may_have_arrived_runs(
    frames: list[tuple[AppliedThrust, str, float]],
) -> None:
    """Whatever becomes of a frame, only a later one that was accepted ends an earlier one before its lease."""
    output, now_ms, ends_ms = OutputTracker(LEASE_MS), 0.0, 0.0
    for decided, outcome, step_ms in frames:
        output.send(decided, now_ms)
        now_ms += step_ms
        match outcome:
            case "accept":
                output.accept(now_ms)
                ends_ms = now_ms + LEASE_MS if decided is AHEAD else 0.0
            case "refuse":
                output.refuse()
            case "lose":
                output.lose(now_ms)
                ends_ms = now_ms + LEASE_MS if decided is AHEAD else ends_ms
        for cause in (m.ZeroCause.NONE, m.ZeroCause.LINE_LOST, m.ZeroCause.REFUSED):
            assert (output.applied(DISARMED, cause, now_ms) == AHEAD) is (now_ms <= ends_ms)
            assert output.applied(DISARMED, cause, max(now_ms, ends_ms) + 1.0) == DISARMED


def test_reports_come_at_their_rate_and_where_the_cause_of_a_zero_changes() -> None:
    schedule = ReportSchedule(50.0, 0.0)
    assert schedule.advance(m.ZeroCause.NO_COMMAND, 0.0) == (True, False)
    assert schedule.advance(m.ZeroCause.NONE, 10.0) == (False, True)
    assert schedule.advance(m.ZeroCause.NONE, 50.0) == (True, False)
    assert schedule.wait_s(60.0) == pytest.approx(0.04)
    assert schedule.advance(m.ZeroCause.TIMEOUT, 60.0) == (False, True)


def test_of_a_silent_microcontroller_nothing_is_claimed() -> None:
    caller = McuCaller("serial:/dev/absent", THRUST)
    state = thrusters_state(caller, Sent(), m.ZeroCause.LINE_LOST, 5, 1000.0)
    assert (state.mcu, state.enabled, state.pulse_left_us, state.answer_age_ms) == (m.McuState.UNKNOWN, False, 0, 1e9)
    assert note_of(state) == "not opened yet"


def test_of_a_line_that_broke_just_now_nothing_is_claimed() -> None:
    caller = McuCaller("serial:/dev/absent", THRUST)
    caller.status, caller.status_ms = LIVE, 999.0
    state = thrusters_state(caller, Sent(), m.ZeroCause.LINE_LOST, 5, 1000.0)
    assert (state.mcu, state.enabled, state.answer_age_ms) == (m.McuState.UNKNOWN, False, 1.0)


@pytest.mark.parametrize(
    ("profile", "sets", "named"),
    [
        (None, ["thrusters.lease_ms=301"], r"thrusters\.lease_ms: .*<= 300"),
        (None, ["thrusters.rate_hz=9"], r"thrusters\.rate_hz"),
        (
            None,
            ["thrusters.rate_hz=10", "thrusters.lease_ms=150"],
            r"thrusters: .*lease_ms 150: shorter than two frames",
        ),
        (None, ["thrusters.line=COM3"], r"thrusters: line: 'COM3' is no port"),
        (
            "hil",
            ["thrusters.line=serial:/dev/ttyACM0"],
            r"thrusters\.line serial:/dev/ttyACM0: .*emulator alone",
        ),
        ("hil", ["thrusters.line=socket://192.0.2.7:5000"], r"thrusters\.line .*emulator alone"),
        ("hil", ["thrusters.line=unix:/run/arduino-router.sock"], r"thrusters\.line .*emulator alone"),
        ("hil", ["plant.pwm_line=socket://192.0.2.7:5000"], r"plant\.pwm_line .*emulator alone"),
        ("hull", ["thrusters.line=socket://127.0.0.1:5000"], r"thrusters\.line .*at a serial device"),
    ],
)
def test_thrust_goes_where_the_profile_says_alone(profile: str | None, sets: list[str], named: str) -> None:
    with pytest.raises(UserError, match=named):
        load_config(profile=profile, sets=sets)


@pytest.mark.parametrize("line", ["socket://127.0.0.1:5001", "serial:/dev/pts/3", "serial:/dev/pts/3@115200"])
def test_an_emulator_is_on_this_machine(line: str) -> None:
    assert load_config(profile="hil", sets=[f"thrusters.line={line}"]).thrusters.line == line
