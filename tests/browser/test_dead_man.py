"""A hand that drives from the page is gone in one of five ways: each is zero thrust within half a second."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Awaitable, Callable
from typing import Any

import pytest
from msgspec.structs import replace

from paani import keys
from paani import messages as m
from paani.clock import WallClock
from paani.config import Config
from tests.arming import arm_on_page
from tests.at_work import at_work
from tests.browser.test_drive import HIDE, MANUAL, WAIT_S
from tests.browser.test_page import until, watch
from tests.conftest import OpenAs, Spawn
from tests.integration.test_modes import LET_GO_S, SERVICES, SETS, Lookout

pytestmark = [pytest.mark.browser, pytest.mark.timeout(180)]

CLOCK = WallClock()
STAYS_S = 1.0
HOLD = "!document.querySelector('[data-drive=HOLD]').disabled"
TAKE = "!document.querySelector('#drive-take').hidden"
CLOCKS_US = 10_000  # the browser takes the time of day once, when a page is loaded
# When the browser had what ends the hold [us of Unix time]; a script of the test is not on the way of a hand.
STAMP = """(name) => addEventListener(name, (event) => {
  window.goneUs = Math.round(1000 * (performance.timeOrigin + event.timeStamp));
}, true)"""


class Link:
    """Carries the page's connections to the dashboard; cut, it lets nothing more pass, and closes nothing."""

    def __init__(self, port: int) -> None:
        self._target, self._passes = port, asyncio.Event()
        self._passes.set()
        self._tasks: set[asyncio.Task[None]] = set()
        self.port = 0

    @contextlib.asynccontextmanager
    async def open(self) -> AsyncIterator[Link]:
        server = await asyncio.start_server(self._carry, "127.0.0.1", 0)
        self.port = server.sockets[0].getsockname()[1]
        try:
            yield self
        finally:
            server.close()
            for task in self._tasks:
                task.cancel()
            await asyncio.gather(*self._tasks, return_exceptions=True)

    def cut(self) -> None:
        self._passes.clear()

    async def _carry(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        self._tasks.add(task)
        far_reader, far_writer = await asyncio.open_connection("127.0.0.1", self._target)
        try:
            async with asyncio.TaskGroup() as both:
                both.create_task(self._pass_on(reader, far_writer))
                both.create_task(self._pass_on(far_reader, writer))
        except* ConnectionError:
            pass
        finally:
            far_writer.close()
            writer.close()
            self._tasks.discard(task)

    async def _pass_on(self, source: asyncio.StreamReader, sink: asyncio.StreamWriter) -> None:
        while data := await source.read(1 << 16):
            await self._passes.wait()
            sink.write(data)
            await sink.drain()
        sink.close()


async def release(page: Any, link: Link) -> None:
    await page.evaluate(STAMP, "keyup")
    await page.keyboard.up("w")


async def blur(page: Any, link: Link) -> None:
    await page.evaluate(STAMP, "blur")
    await page.evaluate("dispatchEvent(new Event('blur'))")


async def hide(page: Any, link: Link) -> None:
    await page.evaluate(STAMP, "visibilitychange")
    await page.evaluate(HIDE, True)


async def close(page: Any, link: Link) -> None:
    await page.close()


async def cut(page: Any, link: Link) -> None:
    link.cut()


End = Callable[[Any, Link], Awaitable[None]]


async def test_a_hand_that_is_gone_is_zero_thrust(browser: Any, open_as: OpenAs, spawn: Spawn, config: Config) -> None:
    lookout = Lookout(await open_as("advisor"), await open_as("observer"))
    async with at_work(lookout.advise_forever(), lookout.keep_reports()), contextlib.AsyncExitStack() as stack:
        services = (*SERVICES, keys.STATION)
        await asyncio.gather(*(stack.enter_async_context(spawn(service, *SETS)) for service in services))
        for ends in ((release, blur, hide, close), (cut,)):
            async with Link(config.dashboard.port).open() as link:
                page = (await watch(browser, replace(config, dashboard=replace(config.dashboard, port=link.port)))).page
                await until(page, f"{TAKE} || {HOLD}")
                if await page.evaluate(TAKE):  # the wheel is that of the page before
                    await page.click("#drive-take")
                await until(page, HOLD)  # the position is known
                for end in ends:
                    await hold_until(end, lookout, page, link, config)
                await page.close()


async def hold_until(end: End, lookout: Lookout, page: Any, link: Link, config: Config) -> None:
    """Drive by hand, armed anew, until this ends it; what the end has left of the hand is then put right."""
    await arm_on_page(f"http://127.0.0.1:{config.dashboard.port}", config.bus)
    await page.wait_for_selector(f"{MANUAL}:enabled", timeout=WAIT_S * 1e3)
    await page.click(MANUAL)
    await until(page, "document.querySelector('#drive').dataset.driving === 'true'")
    await page.keyboard.down("w")
    await lookout.until(lambda: lookout.is_thrusting, "thrust")
    await asyncio.sleep(0.5)
    assert lookout.is_thrusting, f"for as long as it is held: {end.__name__}"

    begun_us = CLOCK.now_us()
    await end(page, link)
    gone_us = begun_us if end in {close, cut} else int(await page.evaluate("window.goneUs"))
    assert begun_us <= gone_us + CLOCKS_US
    await lookout.until(lambda: not lookout.is_thrusting, f"zero thrust: {end.__name__}")
    await asyncio.sleep(STAYS_S)
    after = [report for report in lookout.reports if report.sent_us > gone_us]
    first_zero_us = next(report.sent_us for report in after if is_zero(report))
    assert (first_zero_us - gone_us) * 1e-6 <= LET_GO_S, end.__name__
    assert all(is_zero(report) for report in after if report.sent_us >= first_zero_us), f"and stays so: {end.__name__}"
    if end in {blur, hide}:
        await page.keyboard.up("w")
        await page.evaluate(HIDE, False)


def is_zero(report: m.ThrustApplied) -> bool:
    return (report.left, report.right) == (0.0, 0.0)
