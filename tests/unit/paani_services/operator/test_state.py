"""State of the operator: nothing arms but an unbroken hold by the operator's own clock, and a STOP holds."""

from __future__ import annotations

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paani import messages as m
from paani.keys import STATION
from paani_services.operator import state as op

BEGUN_US = 1_000_000_000


def applied(cause: m.ZeroCause, thrust: float = 0.0) -> m.ThrustApplied:
    return m.ThrustApplied(
        source_us=1, left=thrust, right=thrust, left_n=75 * thrust, right_n=75 * thrust, zero_cause=cause
    )


def held(
    operator: op.Operator, held_s: float, client: str = STATION, press: int = 7, every_s: float = 0.2
) -> op.Operator:
    """The state after a button has been held for so long, said at this interval."""
    said_s = 0.0
    while said_s < held_s:
        operator = op.hold(operator, client, press, BEGUN_US + round(said_s * 1e6))
        said_s += every_s
    return operator


@pytest.mark.parametrize(
    ("latch", "stopped"),
    [(op.CLEAR, False), (op.STOPPED, True), (op.ARMED, True), (None, True), ("", True), ("clear", True), ("x\n", True)],
)
def test_the_state_after_a_start_follows_the_latch_and_is_never_armed(latch: str | None, stopped: bool) -> None:
    state = op.initial_state(latch)
    assert (state.armed, state.stopped) == (False, stopped)
    word = op.arming_message(state, 5)
    assert (word.source_us, word.armed, word.stopped) == (5, False, stopped)
    assert not op.awaits_zero(state), "nobody has asked this process"


@pytest.mark.parametrize(
    ("held_s", "refusal"),
    [
        (0.9, m.ArmRefusal.TOO_SHORT),
        (op.HOLD_MIN_S, m.ArmRefusal.NONE),
        (4.9, m.ArmRefusal.NONE),
        (op.HOLD_MAX_S, m.ArmRefusal.NONE),
        (5.2, m.ArmRefusal.TOO_LONG),
    ],
)
def test_a_press_arms_by_how_long_it_was_held(held_s: float, refusal: m.ArmRefusal) -> None:
    state = held(op.initial_state(op.STOPPED), held_s)
    assert op.judge_release(state, STATION, 7, BEGUN_US + round(held_s * 1e6)) is refusal


def test_a_client_that_was_silent_has_let_go() -> None:
    assert not op.is_silent(op.Hold(STATION, 7, 0, BEGUN_US), BEGUN_US + round(op.REFRESH_MAX_S * 1e6))
    late_us = BEGUN_US + round((op.REFRESH_MAX_S + 1.2) * 1e6)
    state = held(op.initial_state(op.CLEAR), 1.2)
    assert op.judge_release(state, STATION, 7, BEGUN_US + 300_000) is m.ArmRefusal.BROKEN, "the clock was set back"
    assert op.judge_release(state, STATION, 7, late_us) is m.ArmRefusal.BROKEN
    state = op.hold(state, STATION, 7, late_us)
    assert (state.hold, state.ended.refusal) == (None, m.ArmRefusal.BROKEN)
    assert op.hold(state, STATION, 7, late_us + 1) == state, "a press that has ended does not begin again"


def test_nobody_takes_over_anothers_hold() -> None:
    state = held(op.initial_state(op.CLEAR), 1.2)
    other = op.hold(state, "arm", 7, BEGUN_US + 1_100_000)
    assert other == state
    assert op.judge_release(other, "arm", 7, BEGUN_US + 1_200_000) is m.ArmRefusal.BROKEN


def test_a_command_may_not_release_a_stop() -> None:
    state = held(op.initial_state(op.STOPPED), 1.2, client="arm")
    assert op.judge_release(state, "arm", 7, BEGUN_US + 1_200_000) is m.ArmRefusal.LATCHED
    state = held(op.initial_state(op.CLEAR), 1.2, client="arm")
    assert op.judge_release(state, "arm", 7, BEGUN_US + 1_200_000) is m.ArmRefusal.NONE


@pytest.mark.parametrize("client", ["stop", "shore"])
def test_who_may_only_stop_holds_nothing(client: str) -> None:
    """Neither arms nor keeps somebody else's button from arming."""
    state = held(op.initial_state(op.CLEAR), 1.2, client=client)
    assert state == op.initial_state(op.CLEAR)
    assert op.judge_release(state, client, 7, BEGUN_US + 1_200_000) is m.ArmRefusal.BROKEN
    state = held(op.initial_state(op.CLEAR), 1.2)
    assert op.hold(state, client, 8, BEGUN_US + 1_200_000) == state


def test_a_stop_ends_the_hold() -> None:
    state = op.latch_stop(held(op.initial_state(op.CLEAR), 1.2), "stop", BEGUN_US)
    assert (state.hold, state.ended) == (None, op.Ended(STATION, 7, m.ArmRefusal.STOPPED))
    assert op.judge_release(state, STATION, 7, BEGUN_US + 1_200_000) is m.ArmRefusal.BROKEN


def test_stop_holds_until_armed_again() -> None:
    state = op.latch_stop(op.arm(op.Operator(), STATION, 1, 5), "stop", 10)
    assert (op.arming_message(state, 11).armed, op.arming_message(state, 11).stopped) == (False, True)
    state = op.confirm_stop(state, applied(m.ZeroCause.NOT_ARMED), 12)
    assert op.arming_message(state, 13).stopped
    assert op.arming_message(op.arm(state, STATION, 2, 5), 14).armed


def test_a_stop_is_confirmed_only_by_zero_thrust_for_want_of_arming() -> None:
    state = op.latch_stop(op.arm(op.Operator(), STATION, 1, 5), "stop", 1_000)
    for cause, thrust in ((m.ZeroCause.NONE, 0.1), (m.ZeroCause.TIMEOUT, 0.0), (m.ZeroCause.PULSE_LOST, 0.0)):
        state = op.confirm_stop(state, applied(cause, thrust), 20_000)
        assert state.confirmed_us == 0
    for side in ("left", "right"):
        turning = msgspec.structs.replace(applied(m.ZeroCause.NOT_ARMED), **{side: 0.1})
        assert op.confirm_stop(state, turning, 20_000).confirmed_us == 0, "one fan is enough to move"
    state = op.confirm_stop(state, applied(m.ZeroCause.NOT_ARMED), 51_000)
    assert state.confirmed_us - state.asked_us == 50_000
    assert op.confirm_stop(state, applied(m.ZeroCause.NOT_ARMED), 90_000) == state


def test_a_stop_outranks_an_arming_in_every_word() -> None:
    """In what the thrust adapter is told, and in what the next start finds."""
    both = op.Operator(armed=True, stopped=True)
    assert (op.arming_message(both, 5).armed, op.arming_message(both, 5).stopped) == (False, True)
    assert not op.state_message(both, 5, latch_kept=True).armed
    assert op.latch_text(both) == op.STOPPED


def test_a_repeated_stop_keeps_the_time_of_the_first() -> None:
    state = op.latch_stop(op.latch_stop(op.arm(op.Operator(), STATION, 1, 5), "stop", 1_000), STATION, 40_000)
    assert (state.asked_us, state.stops, state.by) == (1_000, 2, STATION)


def test_the_boat_is_armed_for_as_long_as_the_pages_process_lives() -> None:
    state = op.arm(op.Operator(), STATION, 1, 5)
    assert op.follow_station(state, 5, 0.1).armed
    assert op.follow_station(state, 5, op.STATION_SILENT_S - 0.1).armed
    assert not op.follow_station(state, 6, 0.1).armed, "begun again"
    assert not op.follow_station(state, 5, op.STATION_SILENT_S + 0.1).armed
    assert not op.follow_station(op.follow_station(state, 6, 0.1), 5, 0.1).armed, "nothing arms by itself"


ACTS = st.lists(
    st.tuples(
        st.sampled_from(["hold", "release", "stop", "station"]),
        st.sampled_from([STATION, "stop", "shore", "arm"]),
        st.integers(1, 2),
        st.integers(0, 900_000),
    ),
    max_size=60,
)


@given(ACTS)
def test_nothing_arms_but_an_unbroken_hold(acts: list[tuple[str, str, int, int]]) -> None:
    """Whatever is asked by whomever in whatever order: who arms said so at short intervals for at least a second."""
    state, now_us = op.initial_state(op.CLEAR), BEGUN_US
    heard: list[tuple[str, str, int, int]] = []
    for act, client, press, later_us in acts:
        now_us += later_us
        heard.append((act, client, press, now_us))
        if act == "stop":
            state = op.latch_stop(state, client, now_us)
            assert not state.armed
        elif act == "hold":
            state = op.hold(state, client, press, now_us)
        elif act == "station":
            state = op.follow_station(state, press, 0.0)
        else:
            refusal = op.judge_release(state, client, press, now_us)
            if refusal is m.ArmRefusal.NONE:
                assert is_unbroken(heard, client, press, now_us)
                state = op.arm(state, client, press, 1)
            else:
                state = op.refuse(state, client, press, refusal)


def is_unbroken(heard: list[tuple[str, str, int, int]], client: str, press: int, now_us: int) -> bool:
    """Whether this press was said to be held since at least a second, without a gap, a STOP or a release between."""
    last_us = now_us
    for act, who, which, at_us in reversed(heard[:-1]):
        if act == "stop" or (act == "release" and (who, which) == (client, press)):
            return False
        if act == "hold" and (who, which) == (client, press):
            if last_us - at_us > op.REFRESH_MAX_S * 1e6:
                return False
            last_us = at_us
            if now_us - at_us >= op.HOLD_MIN_S * 1e6:
                return True
    return False


def test_a_press_that_is_refused_ends_no_other_hold() -> None:
    holding = held(op.Operator(stopped=False), 1.0)
    other = op.refuse(holding, STATION, 8, m.ArmRefusal.BROKEN)
    assert other.hold == holding.hold
    assert (other.ended.press, other.ended.refusal) == (8, m.ArmRefusal.BROKEN)
    own = op.refuse(holding, STATION, 7, m.ArmRefusal.TOO_SHORT)
    assert (own.hold, own.ended.press) == (None, 7)
    assert op.refuse(op.Operator(), STATION, 7, m.ArmRefusal.BROKEN).hold is None


@pytest.mark.parametrize("asked_us", [1, BEGUN_US])
@pytest.mark.parametrize("since_us", [-5, 0, 1, 2, 500])
def test_a_stop_is_confirmed_after_it_was_asked_for_whatever_the_clock_says(asked_us: int, since_us: int) -> None:
    stopped = op.latch_stop(op.Operator(armed=True, stopped=False), "stop", asked_us)
    confirmed = op.confirm_stop(stopped, applied(m.ZeroCause.NOT_ARMED), asked_us + since_us)
    assert confirmed.confirmed_us == asked_us + max(1, since_us)


def test_a_page_that_is_silent_for_as_long_as_it_may_keeps_the_boat_armed() -> None:
    armed = op.arm(op.Operator(), STATION, 1, station_epoch=9)
    assert op.follow_station(armed, 9, op.STATION_SILENT_S).armed
    assert not op.follow_station(armed, 9, op.STATION_SILENT_S + 0.001).armed
    assert not op.follow_station(armed, 10, 0.0).armed


def test_the_latch_has_a_word_for_each_state() -> None:
    assert op.latch_text(op.Operator(armed=True, stopped=False)) == op.ARMED
    assert op.latch_text(op.Operator(armed=False, stopped=False)) == op.CLEAR
    assert op.latch_text(op.Operator(armed=True, stopped=True)) == op.STOPPED


def test_arming_keeps_the_count_of_stops() -> None:
    stopped = op.latch_stop(op.latch_stop(op.Operator(), "stop", 1_000), "stop", 2_000)
    assert op.arm(stopped, STATION, 4, 9) == op.Operator(
        armed=True, stopped=False, by=STATION, station_epoch=9, stops=2, ended=op.Ended(STATION, 4)
    )


def test_everybody_is_told_the_whole_state() -> None:
    armed = op.hold(op.arm(op.Operator(), STATION, 4, 9), STATION, 5, BEGUN_US)
    message = op.state_message(armed, BEGUN_US + 300_000, latch_kept=True)
    assert (message.source_us, message.armed, message.stopped, message.by) == (BEGUN_US + 300_000, True, False, STATION)
    assert (message.latch_kept, message.stops, message.asked_us, message.confirmed_us) == (True, 0, 0, 0)
    assert (message.hold_by, message.held_ms) == (STATION, 300.0)
    assert (message.press_by, message.press, message.refusal) == (STATION, 4, m.ArmRefusal.NONE)
    silent = op.state_message(armed, BEGUN_US + round(1e6 * op.REFRESH_MAX_S) + 1, latch_kept=False)
    assert (silent.hold_by, silent.held_ms, silent.latch_kept) == ("", 0.0, False)
    assert op.state_message(armed, BEGUN_US - 50, latch_kept=True).held_ms == 0.0
    stopped = op.confirm_stop(op.latch_stop(armed, "stop", 1_000), applied(m.ZeroCause.NOT_ARMED), 2_000)
    message = op.state_message(stopped, 3_000, latch_kept=True)
    assert (message.armed, message.stopped, message.by, message.stops) == (False, True, "stop", 1)
    assert (message.asked_us, message.confirmed_us, message.refusal) == (1_000, 2_000, m.ArmRefusal.STOPPED)
    assert (message.hold_by, message.held_ms, message.press_by, message.press) == ("", 0.0, STATION, 5)
