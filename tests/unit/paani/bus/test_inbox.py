"""What waits between the bus and a process: the newest wins, ages count from receipt, nothing is handed out twice."""

from __future__ import annotations

import asyncio
import math
import time
from collections.abc import Callable

import pytest

from paani.bus.inbox import Latest, Queue
from paani.clock import ManualClock, WallClock
from paani.decider import Input

START_US = 7_000_000


@pytest.fixture
def clock() -> ManualClock:
    return ManualClock(START_US)


async def test_before_the_first_message_nothing_is_fresh_however_long_the_limit(clock: ManualClock) -> None:
    inbox = Latest[str](clock)
    assert inbox.receipt_age_s() == math.inf
    assert inbox.fresh(1e9) is None
    assert (inbox.value, inbox.newest, inbox.received, inbox.superseded) == (None, Input(), 0, 0)
    assert inbox.received_us == 0


async def test_a_message_is_fresh_up_to_the_limit_and_not_beyond(clock: ManualClock) -> None:
    inbox = Latest[str](clock)
    inbox.offer("a")
    assert inbox.newest == Input("a", START_US)
    clock.advance(0.5)
    assert inbox.receipt_age_s() == pytest.approx(0.5)
    assert inbox.fresh(inbox.receipt_age_s()) == "a"
    clock.advance(0.001)
    assert inbox.fresh(0.5) is None
    inbox.offer("b")
    assert (inbox.fresh(0.0), inbox.receipt_age_s()) == ("b", 0.0)


async def test_the_newest_message_replaces_one_that_nobody_took(clock: ManualClock) -> None:
    inbox = Latest[str](clock)
    inbox.offer("a")
    assert inbox.superseded == 0
    inbox.offer("b")
    assert (inbox.received, inbox.superseded, inbox.value) == (2, 1, "b")
    assert await inbox.next() == "b"
    inbox.offer("c")
    assert (inbox.received, inbox.superseded) == (3, 1)


async def test_next_gives_each_message_once_and_waits_for_another(clock: ManualClock) -> None:
    inbox = Latest[str](clock)
    inbox.offer("a")
    assert await inbox.next() == "a"
    waiting = asyncio.create_task(inbox.next())
    await asyncio.sleep(0)
    assert not waiting.done()
    await asyncio.to_thread(inbox.offer, "b")  # as from the bus's own thread
    async with asyncio.timeout(5.0):
        assert await waiting == "b"
    again = asyncio.create_task(inbox.next())
    await asyncio.sleep(0)
    await asyncio.to_thread(inbox.offer, "c")
    async with asyncio.timeout(5.0):
        assert await again == "c"


async def test_a_queue_keeps_order_and_drops_its_oldest(clock: ManualClock) -> None:
    inbox = Queue[int](clock, depth=2)
    assert inbox.drain() == []
    for number in (1, 2):
        inbox.offer(number)
    assert inbox.superseded == 0
    clock.advance(1.0)
    inbox.offer(3)
    assert (inbox.received, inbox.superseded, inbox.received_us) == (3, 1, START_US + 1_000_000)
    inbox.offer(4)
    assert inbox.superseded == 2
    assert inbox.drain() == [3, 4]
    assert inbox.drain() == []
    inbox.offer(4)
    inbox.offer(5)
    assert [await inbox.get(), await inbox.get()] == [4, 5]


async def test_get_waits_for_what_comes_from_another_thread(clock: ManualClock) -> None:
    inbox = Queue[int](clock, depth=2)
    for number in (1, 2):
        waiting = asyncio.create_task(inbox.get())
        await asyncio.sleep(0)
        assert not waiting.done()
        await asyncio.to_thread(inbox.offer, number)
        async with asyncio.timeout(5.0):
            assert await waiting == number


def test_a_message_after_the_loop_has_closed_is_no_error(clock: ManualClock) -> None:
    async def make() -> Latest[str]:
        return Latest[str](clock)

    inbox = asyncio.run(make())
    inbox.offer("late")
    assert inbox.value == "late"


async def test_many_messages_wake_the_loop_once(clock: ManualClock, monkeypatch: pytest.MonkeyPatch) -> None:
    """A burst costs the loop one wake-up, and the next message after it another."""
    inbox, loop, wakes = Queue[int](clock, depth=9), asyncio.get_running_loop(), list[object]()
    call_soon = loop.call_soon_threadsafe

    def count(callback: Callable[[], object]) -> object:
        wakes.append(callback)
        return call_soon(callback)

    monkeypatch.setattr(loop, "call_soon_threadsafe", count)
    for number in range(5):
        inbox.offer(number)
    assert len(wakes) == 1
    await asyncio.sleep(0.0)
    inbox.offer(5)
    assert len(wakes) == 2


async def test_a_wall_clock_that_is_set_makes_no_message_younger(monkeypatch: pytest.MonkeyPatch) -> None:
    inbox = Latest[str](WallClock())
    inbox.offer("a")
    hour_ns = 3_600_000_000_000
    monkeypatch.setattr(time, "time_ns", lambda: inbox.received_us * 1000 - hour_ns)
    assert 0.0 <= inbox.receipt_age_s() < 60.0
    later_ns = time.monotonic_ns() + hour_ns
    monkeypatch.setattr(time, "monotonic_ns", lambda: later_ns)
    assert inbox.receipt_age_s() > 3500.0
    assert inbox.fresh(0.3) is None


@pytest.mark.parametrize("kind", [Latest, Queue])
async def test_a_receipt_is_noted_when_its_message_is_there(kind: type[Latest[str] | Queue[str]]) -> None:
    """Another thread that sees the new time takes whatever lies there for new."""
    found = list[object]()

    class LookingClock(ManualClock):
        def now_us(self) -> int:
            found.append(inbox.value if isinstance(inbox, Latest) else list(inbox._items))
            return super().now_us()

    inbox: Latest[str] | Queue[str] = Latest(LookingClock()) if kind is Latest else Queue(LookingClock(), 4)
    inbox.offer("a")
    assert found
    assert all(each in ("a", ["a"]) for each in found)
