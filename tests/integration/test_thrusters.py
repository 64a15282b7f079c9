"""The thrusters of a hull over a real router and a pseudo-terminal: whatever is wrong is zero, with its cause."""

from __future__ import annotations

import asyncio
import itertools
import statistics
from collections.abc import AsyncIterator, Callable
from pathlib import Path

import pytest

from paani import messages as m
from paani.bus import Bus
from paani.clock import stopwatch_ms
from paani.config import Config, load_config
from paani.errors import UserError
from paani.microcontroller.rpc import Request
from paani_services.thrusters.service import run
from tests.at_work import at_work
from tests.mcu_peer import PtyLine, until
from tests.thrust_peer import BATTERY, ESTOP, RECEIVER, ThrustPeer
from tests.thruster_bus import CLOCK, PULSES, ThrusterBus, opened

pytestmark = pytest.mark.integration


class Boat(ThrusterBus):
    """The bus, the microcontroller at the end of the line, and the line."""

    def __init__(self, config: Config, buses: dict[str, Bus], peer: ThrustPeer, line: PtyLine) -> None:
        super().__init__(config, buses)
        self.peer, self.line = peer, line


@pytest.fixture
async def boat(private_sets: tuple[str, ...], tmp_path: Path) -> AsyncIterator[Boat]:
    peer, path = ThrustPeer(), tmp_path / "ttyTHRUST"
    line = PtyLine(str(path), peer)
    config = load_config(profile="hull", sets=(*private_sets, f"thrusters.line={line.address}", PULSES))
    async with opened(config) as buses:
        line.plug_in()
        found = Boat(config, buses, peer, line)
        try:
            async with at_work(run(buses["thrusters"], CLOCK, config), found.speak()):
                yield found
        finally:
            line.pull_out()


async def stays(condition: Callable[[], bool], seconds: float) -> None:
    end_ms = stopwatch_ms() + seconds * 1e3
    while stopwatch_ms() < end_ms:
        assert condition()
        await asyncio.sleep(0.01)


async def test_settings_go_first_and_then_thrust_at_ten_hertz_and_more(boat: Boat) -> None:
    await boat.drive()
    assert boat.peer.settings[0].session == boat.peer.thrusts[0][1].session
    count = len(boat.peer.thrusts)
    await asyncio.sleep(2.0)
    frames = boat.peer.thrusts[count:]
    assert len(frames) >= 20
    gaps_ms = [after - before for (before, _), (after, _) in itertools.pairwise(frames)]
    assert statistics.median(gaps_ms) < 100.0
    assert boat.peer.lease_ms <= 300
    assert all(call.armed and call.left == call.right == 0.2 for _, call in frames)
    assert [call.seq for _, call in frames] == sorted({call.seq for _, call in frames})
    applied, state = boat.applied.value, boat.state.value
    assert applied is not None
    assert state is not None
    assert (applied.left, applied.left_n, applied.producer) == (0.2, 15.0, "thrusters")
    assert (state.mcu, state.enabled, state.pulse_left_us, state.problem) == (m.McuState.FRESH, True, 1580, "")


async def test_without_the_operators_word_nothing_is_sent_that_could_clear_a_stop(boat: Boat) -> None:
    """A disarmed frame is the operator's leave to arm again: a start of this process must not give it."""
    await until(lambda: len(boat.peer.calls) > 20)
    assert not boat.peer.thrusts
    assert {call.method for call in boat.peer.calls} == {"paani_status"}
    assert boat.cause is m.ZeroCause.NOT_ARMED
    boat.armed = False
    await until(lambda: len(boat.peer.thrusts) > 3)
    assert all(not call.armed and call.left == 0.0 for _, call in boat.peer.thrusts)


async def test_an_operator_who_had_armed_before_this_process_began_arms_again(boat: Boat) -> None:
    """A restart of this process does not go on where it was killed."""
    boat.armed = True
    await boat.until_cause(m.ZeroCause.REARM)
    await stays(lambda: boat.peer.pulses_us() == (1500, 1500), 1.0)
    await boat.drive()


async def test_a_stop_reaches_the_microcontroller_before_it_is_confirmed(boat: Boat) -> None:
    await boat.drive()
    boat.armed = False
    started_ms = stopwatch_ms()
    await boat.until_cause(m.ZeroCause.NOT_ARMED)
    assert stopwatch_ms() - started_ms < 500.0
    assert not boat.peer.newest.armed
    assert boat.peer.pulses_us() == (1500, 1500)


async def test_words_that_stop_coming_give_zero_but_no_disarmed_frame(boat: Boat) -> None:
    await boat.drive()
    boat.armed = None
    await boat.until_cause(m.ZeroCause.ARMING_LOST)
    assert boat.peer.newest.armed
    assert (boat.peer.newest.left, boat.peer.newest.right) == (0.0, 0.0)
    boat.armed, boat.is_pulsing = True, False
    await boat.until_cause(m.ZeroCause.PULSE_LOST)
    assert (boat.peer.newest.left, boat.peer.newest.right) == (0.0, 0.0)


async def test_a_word_counts_from_when_it_was_said_and_not_from_when_it_came(boat: Boat) -> None:
    """However steadily old ones come, as over a link that holds them up."""
    await boat.drive()
    boat.word_age_us = 600_000
    await boat.until_cause(m.ZeroCause.ARMING_LOST)
    await stays(lambda: boat.peer.newest.left == boat.peer.newest.right == 0.0, 0.5)


async def test_an_emergency_stop_wins_and_arming_again_needs_a_disarm_first(boat: Boat) -> None:
    """W9: whatever the software orders meanwhile, and after the button is released."""
    await boat.drive()
    boat.peer.hold(ESTOP)
    await boat.until_cause(m.ZeroCause.EMERGENCY_STOP)
    assert boat.peer.pulses_us() == (1500, 1500)
    boat.peer.hold(0)
    await stays(lambda: boat.peer.pulses_us() == (1500, 1500), 1.0)
    assert boat.state.value is not None
    assert boat.state.value.holds == (m.ThrustHold.EMERGENCY_STOP, m.ThrustHold.NOT_ARMED)
    await boat.drive()
    assert boat.peer.pulses_us() == (1580, 1580)


@pytest.mark.parametrize(("held", "cause"), [(RECEIVER, m.ZeroCause.RECEIVER), (BATTERY, m.ZeroCause.BATTERY_LOW)])
async def test_what_holds_on_the_microcontroller_is_shown(boat: Boat, held: int, cause: m.ZeroCause) -> None:
    await boat.drive()
    boat.peer.hold(held)
    boat.peer.rc = 2 if held == RECEIVER else 0
    await boat.until_cause(cause)
    await until(lambda: boat.state.value is not None and bool(boat.state.value.holds))
    assert boat.state.value is not None
    assert (boat.state.value.receiver is m.ReceiverState.TAKEN_OVER) is (held == RECEIVER)
    assert boat.buses["thrusters"].note_text.startswith("fresh; held by")
    boat.peer.hold(0)
    await stays(lambda: boat.cause is cause, 0.5)
    await boat.drive()


async def test_a_line_that_is_pulled_out_is_named_and_comes_back(boat: Boat) -> None:
    await boat.drive()
    boat.line.pull_out()
    await boat.until_cause(m.ZeroCause.LINE_LOST)
    await until(lambda: boat.state.value is not None and "ttyTHRUST" in boat.state.value.problem)
    assert boat.state.value is not None
    assert not boat.state.value.connected
    received = boat.time.received
    await asyncio.sleep(0.5)
    assert boat.time.received > received, "the clock that orders echo goes on"
    boat.line.plug_in()
    await boat.until_cause(m.ZeroCause.NONE)  # this microcontroller has not begun to refuse


async def test_a_microcontroller_that_restarts_gets_its_settings_again(boat: Boat) -> None:
    await boat.drive()
    before = boat.peer.session
    boat.peer.reset()
    await until(lambda: boat.peer.session not in {0, before}, 8.0)
    assert boat.peer.settings[-1].session == boat.peer.session
    await boat.until_cause(m.ZeroCause.REARM)
    await boat.drive()
    assert boat.buses["thrusters"].drops["microcontroller_restarted"] == 1


async def test_settings_that_the_microcontroller_has_lost_are_sent_again(boat: Boat) -> None:
    await boat.drive()
    count = len(boat.peer.settings)
    boat.peer.configured = 0
    await until(lambda: len(boat.peer.settings) > count, 8.0)
    assert boat.buses["thrusters"].drops["refused_not_configured"] >= 1
    await boat.drive()


async def test_a_second_session_is_refused_and_says_so(boat: Boat) -> None:
    """Two of these processes on one microcontroller: who drives goes on, the other gives no thrust."""
    boat.peer.configured, boat.peer.session = 0, 4711
    boat.peer.accepted_ms, boat.peer.lease_ms = stopwatch_ms() + 2500.0, 0.0
    boat.armed = True
    await boat.until_cause(m.ZeroCause.REFUSED)
    assert not boat.peer.thrusts
    await until(lambda: bool(boat.peer.thrusts), 8.0)  # once the other's lease is over
    await boat.drive()


async def test_a_line_must_be_named(boat: Boat) -> None:
    config = load_config(profile="hull")
    with pytest.raises(UserError, match=r"thrusters\.line: not set"):
        await run(boat.buses["thrusters"], CLOCK, config)


async def test_a_microcontroller_that_falls_silent_gives_zero_within_its_lease(boat: Boat) -> None:
    await boat.drive()
    boat.peer.answers = lambda request: b""
    started_ms = stopwatch_ms()
    await boat.until_cause(m.ZeroCause.LINE_LOST)
    assert stopwatch_ms() - started_ms < boat.peer.lease_ms + 300.0
    await until(lambda: boat.state.value is not None and "no answer from the mic" in boat.state.value.problem)
    await until(lambda: boat.state.value is not None and boat.state.value.mcu is m.McuState.UNKNOWN)


async def test_a_microcontroller_whose_answers_are_lost_is_told_to_lie_still(boat: Boat) -> None:
    """It would drive on, and nobody would know; and a STOP counts only when the last frame's lease is over."""
    await boat.drive()
    answer = boat.peer.answer

    def lose(request: Request) -> bytes:
        answer(request)
        return b""

    boat.peer.answers = lose
    await until(lambda: boat.peer.newest.left == boat.peer.newest.right == 0.0)
    assert boat.peer.newest.armed
    assert all(call.left == 0.2 for _, call in boat.peer.thrusts[-3:-1])
    assert boat.peer.thrusts[-1][0] - boat.peer.thrusts[-2][0] < 2 * boat.peer.lease_ms
    boat.peer.answers = answer
    await until(lambda: boat.peer.newest.left == 0.2)


async def test_a_stop_counts_when_the_lease_of_a_frame_is_over_whose_answer_was_lost(boat: Boat) -> None:
    await boat.drive()
    answer, count = boat.peer.answer, len(boat.peer.thrusts)
    boat.peer.answers = lambda request: answer(request)[:0]
    await until(lambda: len(boat.peer.thrusts) > count)
    boat.armed = False
    await boat.until_cause(m.ZeroCause.NOT_ARMED)
    last_ms = max(at_ms for at_ms, call in boat.peer.thrusts if call.left > 0.0)
    assert stopwatch_ms() - last_ms >= boat.peer.lease_ms
