"""Requests of one client, answered in turn: a STOP waits for nothing that the disk holds up."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from paani import messages as m
from paani.keys import STATION
from paani_services.operator import state as op
from paani_services.operator.latch import write_latch
from paani_services.operator.service import answer_forever
from tests.at_work import at_work
from tests.unit.paani_services.operator.test_console import EPOCH, Desk

STOP, RELEASE = (m.OperatorRequest(source_us=1, act=act, press=1) for act in (m.RequestAct.STOP, m.RequestAct.RELEASE))


class Station:
    """The page's process, alive."""

    value = m.Pulse(source_us=1, epoch=EPOCH)

    def receipt_age_s(self) -> float:
        return 0.0


async def until(condition: Callable[[], bool]) -> None:
    async with asyncio.timeout(10.0):
        while not condition():
            await asyncio.sleep(0)


async def test_a_stop_does_not_wait_for_an_arming_of_its_own_client_that_the_disk_holds_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A disk that takes its time keeps no STOP waiting, and arms nobody after it, however often he let go."""
    desk, may_write, inbox = Desk(tmp_path), threading.Event(), asyncio.Queue[m.OperatorRequest]()

    def write_late(path: Path, text: str) -> bool:
        assert may_write.wait(10.0)
        return write_latch(path, text)

    monkeypatch.setattr("paani_services.operator.console.write_latch", write_late)
    await desk.hold()
    station: Any = Station()
    async with at_work(answer_forever(desk.console, STATION, inbox, station)):  # type: ignore[arg-type]  # the bus's place
        for request in (RELEASE, RELEASE, STOP, RELEASE):
            inbox.put_nowait(request)
        try:
            await until(lambda: desk.console.state.stops == 1)
            assert desk.arming.messages[-1].stopped
        finally:
            may_write.set()
        async with asyncio.timeout(10.0):
            while await desk.latch() != op.STOPPED:
                await asyncio.sleep(0)
    assert not any(word.armed for word in desk.arming.messages)


async def test_requests_of_a_client_are_answered_in_the_order_it_asks(tmp_path: Path) -> None:
    desk, inbox = Desk(tmp_path), asyncio.Queue[m.OperatorRequest]()
    station: Any = Station()
    async with at_work(answer_forever(desk.console, STATION, inbox, station)):  # type: ignore[arg-type]  # the bus's place
        for press in (1, 2):
            await desk.hold(press)
            inbox.put_nowait(m.OperatorRequest(source_us=1, act=m.RequestAct.RELEASE, press=press))
            await until(lambda press=press: desk.console.state.ended.press == press)  # type: ignore[misc]  # of a default
            assert desk.console.state.armed
