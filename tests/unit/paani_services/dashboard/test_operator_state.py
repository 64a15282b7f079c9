"""State of the operator: a STOP holds until the next arming, and a latch that is not clear is a STOP."""

from __future__ import annotations

import asyncio
import stat
from pathlib import Path

import pytest

from paani import messages as m
from paani.clock import ManualClock
from paani_services.dashboard import operator_state as op
from paani_services.dashboard.console import LATCH_FILE, Console, read_latch, write_latch


def applied(cause: m.ZeroCause, thrust: float = 0.0) -> m.ThrustApplied:
    return m.ThrustApplied(
        source_us=1, left=thrust, right=thrust, left_n=75 * thrust, right_n=75 * thrust, zero_cause=cause
    )


class PublishedArming:
    """Keeps what the console publishes, in place of the bus."""

    def __init__(self) -> None:
        self.messages: list[m.Arming] = []

    def put(self, message: m.Arming) -> m.Arming:
        self.messages.append(message)
        return message


def console(folder: Path) -> tuple[Console, PublishedArming]:
    published = PublishedArming()
    return Console(published, folder, ManualClock()), published  # type: ignore[arg-type]  # the bus's place at the edge


@pytest.mark.parametrize(
    ("latch", "arm_at_start", "armed", "stopped"),
    [
        (None, False, False, False),
        (None, True, True, False),
        (op.CLEAR, True, True, False),
        (op.STOPPED, True, False, True),
        (op.STOPPED, False, False, True),
        ("", True, False, True),
        ("clear", True, False, True),
        ("nonsense\n", True, False, True),
    ],
)
def test_the_state_after_a_start_follows_the_latch(
    latch: str | None, arm_at_start: bool, armed: bool, stopped: bool
) -> None:
    state = op.initial_state(latch, arm_at_start=arm_at_start)
    assert (state.armed, state.stopped) == (armed, stopped)
    word = op.arming_message(state, 5)
    assert (word.armed, word.stopped) == (armed, stopped)


def test_stop_holds_until_armed_again() -> None:
    state = op.latch_stop(op.arm(op.OperatorState()), 10)
    assert (op.arming_message(state, 11).armed, op.arming_message(state, 11).stopped) == (False, True)
    state = op.confirm_stop(state, applied(m.ZeroCause.NOT_ARMED), 12)
    assert op.arming_message(state, 13).stopped
    assert op.arming_message(op.arm(state), 14).armed


def test_a_stop_is_confirmed_only_by_zero_thrust_for_want_of_arming() -> None:
    state = op.latch_stop(op.OperatorState(armed=True), 1_000)
    for cause, thrust in ((m.ZeroCause.NONE, 0.1), (m.ZeroCause.TIMEOUT, 0.0), (m.ZeroCause.PULSE_LOST, 0.0)):
        state = op.confirm_stop(state, applied(cause, thrust), 20_000)
        assert state.confirmed_us == 0
    state = op.confirm_stop(state, applied(m.ZeroCause.NOT_ARMED), 51_000)
    assert state.confirmed_us - state.asked_us == 50_000
    assert op.confirm_stop(state, applied(m.ZeroCause.NOT_ARMED), 90_000) == state


def test_a_repeated_stop_keeps_the_time_of_the_first() -> None:
    state = op.latch_stop(op.latch_stop(op.OperatorState(armed=True), 1_000), 40_000)
    assert (state.asked_us, state.stops) == (1_000, 2)


async def test_a_stop_is_published_before_it_is_written_and_outlives_the_process(tmp_path: Path) -> None:
    first, published = console(tmp_path)
    await first.restore(arm_at_start=True)
    assert first.state.armed
    asking = asyncio.create_task(first.stop())
    await asyncio.sleep(0)
    assert published.messages[-1].stopped
    assert await asking
    again, _ = console(tmp_path)
    await again.restore(arm_at_start=True)
    assert again.state.stopped
    assert not again.state.armed


async def test_arming_releases_the_latch_on_disk(tmp_path: Path) -> None:
    first, published = console(tmp_path)
    await first.stop()
    assert await first.arm()
    assert (published.messages[-1].armed, published.messages[-1].stopped) == (True, False)
    assert await asyncio.to_thread(read_latch, tmp_path / LATCH_FILE) == op.CLEAR


async def test_a_stop_during_arming_wins(tmp_path: Path) -> None:
    first, published = console(tmp_path)
    await first.stop()
    arming = asyncio.create_task(first.arm())
    await asyncio.sleep(0)
    stopping = asyncio.create_task(first.stop())
    assert not await arming
    assert await stopping
    assert first.state.stopped
    assert not any(word.armed for word in published.messages)
    assert await asyncio.to_thread(read_latch, tmp_path / LATCH_FILE) == op.STOPPED


async def test_a_failing_disk_stops_and_does_not_arm(tmp_path: Path) -> None:
    first, published = console(tmp_path / "missing")
    assert not await first.stop()
    assert published.messages[-1].stopped
    assert not await first.arm()
    assert first.state.stopped


async def test_the_last_message_is_that_nobody_arms(tmp_path: Path) -> None:
    first, published = console(tmp_path)
    await first.restore(arm_at_start=True)
    speaking = asyncio.create_task(first.publish_forever())
    await asyncio.sleep(0.01)
    assert published.messages[-1].armed
    speaking.cancel()
    with pytest.raises(asyncio.CancelledError):
        await speaking
    assert not published.messages[-1].armed


def test_the_latch_file_is_private_and_whole(tmp_path: Path) -> None:
    path = tmp_path / LATCH_FILE
    assert write_latch(path, op.STOPPED)
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert [file.name for file in tmp_path.iterdir()] == [LATCH_FILE]


def test_an_unreadable_latch_is_a_stop(tmp_path: Path) -> None:
    path = tmp_path / LATCH_FILE
    path.write_bytes(b"\xff\xfe")
    assert op.initial_state(read_latch(path), arm_at_start=True).stopped
    path.unlink()
    path.mkdir()
    assert op.initial_state(read_latch(path), arm_at_start=True).stopped
