"""The console: a STOP is published before it is written, and whatever cannot be written is a STOP."""

from __future__ import annotations

import asyncio
import logging
import stat
from pathlib import Path
from typing import Any

import pytest

from paani import messages as m
from paani.clock import ManualClock
from paani.keys import STATION
from paani_services.operator import state as op
from paani_services.operator.console import Console
from paani_services.operator.latch import LATCH_FILE, read_latch, write_latch
from tests.at_work import at_work

EPOCH = 5


class Published:
    """Keeps what the console publishes, in place of the bus."""

    def __init__(self) -> None:
        self.messages: list[Any] = []

    def put(self, message: Any) -> Any:
        self.messages.append(message)
        return message


class Desk:
    """A console on a folder, and a clock that moves when a button is held."""

    def __init__(self, folder: Path) -> None:
        self.clock, self.arming, self.states, self.orders = ManualClock(), Published(), Published(), Published()
        self.clock.advance(1000.0)
        self.path = folder / LATCH_FILE
        self.missions = Published()
        publishers = self.arming, self.states, self.orders, self.missions
        self.console = Console(*publishers, folder, self.clock)  # type: ignore[arg-type]  # the bus's place

    def last_mode(self) -> m.DriveMode:
        state: m.OperatorState = self.states.messages[-1]
        return state.mode

    async def order(self, act: m.RequestAct, press: int, mode: m.DriveMode = m.DriveMode.IDLE) -> None:
        """Ask for a mode, or drive ahead."""
        request = m.OperatorRequest(source_us=1, act=act, press=press, hand=3, mode=mode, surge=0.5)
        await self.console.answer(STATION, request, EPOCH)

    async def ask(self, act: m.RequestAct, press: int = 1, client: str = STATION) -> None:
        await self.console.answer(client, m.OperatorRequest(source_us=1, act=act, press=press), EPOCH)

    async def hold(self, press: int = 1) -> None:
        for _ in range(7):
            await self.ask(m.RequestAct.HOLD, press)
            self.clock.advance(0.2)

    async def arm(self, press: int = 1) -> None:
        await self.hold(press)
        await self.ask(m.RequestAct.RELEASE, press)

    async def latch(self) -> str | None:
        return await asyncio.to_thread(read_latch, self.path)


async def test_a_stop_is_published_before_it_is_written_and_outlives_the_process(tmp_path: Path) -> None:
    desk = Desk(tmp_path)
    await desk.arm()
    assert desk.console.state.armed
    asking = asyncio.create_task(desk.ask(m.RequestAct.STOP))
    await asyncio.sleep(0)
    assert desk.arming.messages[-1].stopped
    await asking
    assert await desk.latch() == op.STOPPED
    again = Desk(tmp_path)
    await again.console.restore()
    assert (again.console.state.armed, again.console.state.stopped) == (False, True)


async def test_a_process_that_dies_while_armed_is_a_stop_for_the_next(tmp_path: Path) -> None:
    """So is a STOP that could not be written: the latch on disk is clear only while nobody is armed."""
    desk = Desk(tmp_path)
    await desk.arm()
    assert await desk.latch() == op.ARMED
    again = Desk(tmp_path)
    await again.console.restore()
    assert (again.console.state.armed, again.console.state.stopped) == (False, True)


async def test_an_end_in_good_order_leaves_a_clear_latch_and_a_stop_leaves_a_stop(tmp_path: Path) -> None:
    desk = Desk(tmp_path)
    await desk.arm()
    await desk.console.end()
    assert not desk.arming.messages[-1].armed
    assert await desk.latch() == op.CLEAR
    await desk.ask(m.RequestAct.STOP)
    await desk.console.end()
    assert await desk.latch() == op.STOPPED


async def test_a_stop_during_arming_wins(tmp_path: Path) -> None:
    desk = Desk(tmp_path)
    await desk.hold()
    arming = asyncio.create_task(desk.ask(m.RequestAct.RELEASE))
    await asyncio.sleep(0)
    await asyncio.gather(arming, desk.ask(m.RequestAct.STOP, client="stop"))
    assert desk.console.state.stopped
    assert not any(word.armed for word in desk.arming.messages)
    assert desk.states.messages[-1].refusal is m.ArmRefusal.STOPPED
    assert await desk.latch() == op.STOPPED


async def test_a_release_that_is_said_again_changes_nothing(tmp_path: Path) -> None:
    desk = Desk(tmp_path)
    await desk.arm()
    await desk.ask(m.RequestAct.RELEASE)
    assert (desk.console.state.armed, desk.console.state.ended.refusal) == (True, m.ArmRefusal.NONE)
    await desk.ask(m.RequestAct.STOP)
    await desk.ask(m.RequestAct.RELEASE)
    assert desk.console.state.stopped


async def test_a_failing_disk_stops_and_does_not_arm(tmp_path: Path) -> None:
    desk = Desk(tmp_path / "missing")
    await desk.arm()
    assert (desk.console.state.armed, desk.states.messages[-1].refusal) == (False, m.ArmRefusal.NOT_WRITTEN)
    await desk.ask(m.RequestAct.STOP)
    assert desk.arming.messages[-1].stopped
    assert not desk.states.messages[-1].latch_kept


@pytest.mark.parametrize(("write_s", "is_armed"), [(0.9, True), (1.0, False), (8.0, False)])
async def test_a_slow_disk_arms_nobody_who_let_the_button_go_long_ago(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, write_s: float, *, is_armed: bool
) -> None:
    desk = Desk(tmp_path)

    def write_slowly(path: Path, text: str) -> bool:
        desk.clock.advance(write_s)
        return write_latch(path, text)

    monkeypatch.setattr("paani_services.operator.console.write_latch", write_slowly)
    await desk.arm()
    assert desk.console.state.armed is is_armed
    assert any(message.armed for message in desk.arming.messages) is is_armed
    assert (desk.states.messages[-1].refusal is m.ArmRefusal.NONE) is is_armed
    assert await desk.latch() == (op.ARMED if is_armed else op.STOPPED)


async def test_without_the_pages_process_nobody_arms(tmp_path: Path) -> None:
    desk = Desk(tmp_path)
    await desk.hold()
    await desk.console.answer(STATION, m.OperatorRequest(source_us=1, act=m.RequestAct.RELEASE, press=1), None)
    assert (desk.console.state.armed, desk.states.messages[-1].refusal) == (False, m.ArmRefusal.NO_STATION)


async def test_a_page_that_begins_again_disarms(tmp_path: Path) -> None:
    desk = Desk(tmp_path)
    await desk.arm()
    await desk.console.follow_station(EPOCH + 1, 0.0)
    assert (desk.arming.messages[-1].armed, desk.arming.messages[-1].stopped) == (False, False)
    assert await desk.latch() == op.CLEAR


def test_the_latch_file_is_private_and_whole(tmp_path: Path) -> None:
    path = tmp_path / LATCH_FILE
    assert write_latch(path, op.STOPPED)
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert [file.name for file in tmp_path.iterdir()] == [LATCH_FILE]


def test_an_unreadable_latch_is_a_stop(tmp_path: Path) -> None:
    path = tmp_path / LATCH_FILE
    path.write_bytes(b"\xff\xfe")
    assert read_latch(path) == ""
    assert op.initial_state(read_latch(path)).stopped
    path.unlink()
    path.mkdir()
    assert op.initial_state(read_latch(path)).stopped


async def test_a_stop_ends_manual_and_arming_again_does_not_bring_it_back(tmp_path: Path) -> None:
    desk = Desk(tmp_path)
    await desk.order(m.RequestAct.MODE, 90, m.DriveMode.MANUAL)
    assert desk.states.messages[-1].mode_refusal is m.ModeRefusal.NOT_ARMED
    await desk.arm(1)
    await desk.order(m.RequestAct.MODE, 91, m.DriveMode.MANUAL)
    await desk.order(m.RequestAct.DRIVE, 92)
    assert (desk.orders.messages[-1].mode, desk.orders.messages[-1].surge) == (m.DriveMode.MANUAL, 0.5)
    await desk.ask(m.RequestAct.STOP)
    assert desk.orders.messages[-1].mode is m.DriveMode.IDLE
    await desk.arm(2)
    assert desk.console.state.armed
    await desk.order(m.RequestAct.DRIVE, 93)
    assert (desk.orders.messages[-1].mode, desk.orders.messages[-1].surge) == (m.DriveMode.IDLE, 0.0)


async def test_an_override_is_logged_when_it_begins_and_when_it_ends(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    desk = Desk(tmp_path)
    await desk.arm(1)
    await desk.order(m.RequestAct.MODE, 91, m.DriveMode.MANUAL)
    await desk.order(m.RequestAct.OVERRIDE, 92)
    await desk.order(m.RequestAct.DRIVE, 93)
    await desk.ask(m.RequestAct.STOP)
    lines = [record.getMessage() for record in caplog.records if "overrid" in record.getMessage()]
    assert lines == ["dashboard overrides the advice for 10 s", "the advice is no longer overridden: DISARMED"]
    assert desk.states.messages[-1].override_end is m.OverrideEnd.DISARMED


async def test_no_request_for_a_mode_arms(tmp_path: Path) -> None:
    desk = Desk(tmp_path)
    for press, mode in enumerate(m.DriveMode):
        await desk.order(m.RequestAct.MODE, 10 + press, mode)
    await desk.order(m.RequestAct.WHEEL, 20)
    await desk.order(m.RequestAct.OVERRIDE, 21)
    assert not any(word.armed for word in desk.arming.messages)


async def test_the_order_is_published_before_the_word_that_arms_and_a_silent_hand_is_noticed(tmp_path: Path) -> None:
    desk = Desk(tmp_path)
    published: list[Any] = []
    for each in (desk.arming, desk.orders):
        each.messages = published
    await desk.arm()
    armed = next(number for number, word in enumerate(published) if isinstance(word, m.Arming) and word.armed)
    assert isinstance(published[armed - 1], m.OperatorOrder)
    assert published[armed].mode_ordered
    await desk.order(m.RequestAct.MODE, 91, m.DriveMode.MANUAL)
    await desk.order(m.RequestAct.DRIVE, 92)
    async with at_work(desk.console.watch_wheel()):
        await asyncio.sleep(0)
        assert desk.last_mode() is m.DriveMode.MANUAL
        desk.clock.advance(0.31)
        await asyncio.sleep(0.05)
    assert [word for word in published if isinstance(word, m.OperatorOrder)][-1].mode is m.DriveMode.IDLE
    assert desk.last_mode() is m.DriveMode.IDLE
