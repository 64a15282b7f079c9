"""Measures the page of a boat that is under way: loads, pictures, clients, STOP, stick, heap."""

from __future__ import annotations

import asyncio
import os
from collections.abc import Callable
from pathlib import Path

import aiohttp
from playwright.async_api import Error as BrowserError

from paani import keys
from paani import messages as m
from paani.bus import Bus, Queue
from paani.clock import WallClock
from paani.config import Config
from paani.operator_key import ensure_operator_key
from paani.page_address import page_origin
from paani_tools.bench.deck.browser import Browser, Deck
from paani_tools.bench.deck.crowd import crowd
from paani_tools.bench.deck.report import Crowd

CLOCK = WallClock()
NO_ANSWER = (TimeoutError, OSError, aiohttp.ClientError, BrowserError)  # of the boat, the server, the page
ANSWER_S = 3.0  # of a STOP or a stick that nothing follows
UNDER_WAY_S = 30.0
HOLD_S, REFRESH_S = 1.3, 0.15
PHASE_S, PHASES = 0.037, 7  # so that presses fall on no clock's beat
TURNING = 0.05  # difference of the fans' thrust that is a turn and no trim
HEAP_PERIOD_S = 10.0
WARM_UP = 0.2  # of the time: what a page keeps fills meanwhile


class Boat:
    """The running boat, as heard on the bus, and the operator's hand that arms it."""

    def __init__(self, bus: Bus, config: Config) -> None:
        self._config, self._origin = config, page_origin(config)
        self.applied: Queue[m.ThrustApplied] = bus.queue(keys.THRUST_APPLIED)
        self._advice: Queue[m.Advisory] = bus.queue(keys.ADVISORY)

    async def arm(self) -> None:
        """Hold the button, which also releases a STOP. Raises TimeoutError where the boat does not come under way."""
        key = await asyncio.to_thread(ensure_operator_key, self._config.bus)
        headers, body = {"Origin": self._origin, "X-Paani-Key": key}, {"press": CLOCK.now_us()}
        async with aiohttp.ClientSession(headers=headers) as client:
            for _ in range(round(HOLD_S / REFRESH_S)):
                async with client.post(f"{self._origin}/api/arm/hold", json=body):
                    await asyncio.sleep(REFRESH_S)
            async with client.post(f"{self._origin}/api/arm/release", json=body):
                pass

    async def until_applied(self, is_it: Callable[[m.ThrustApplied], bool], since_us: float, wait_s: float) -> float:
        """When the thrust adapter first says so after `since_us` [us]. Raises TimeoutError."""
        try:
            async with asyncio.timeout(wait_s):
                while True:
                    report = await self.applied.get()
                    if report.source_us >= since_us and is_it(report):
                        return float(report.source_us)
        except TimeoutError:
            raise TimeoutError(f"the thrust that was waited for was not applied within {wait_s:g} s") from None

    async def decisions_hz(self, seconds: float) -> float:
        """Decisions a second, heard for so long."""
        self._advice.drain()
        await asyncio.sleep(seconds)
        return len(self._advice.drain()) / seconds


def is_under_way(report: m.ThrustApplied) -> bool:
    """Whether any thrust is applied."""
    return report.zero_cause is m.ZeroCause.NONE and (report.left != 0.0 or report.right != 0.0)


def is_stopped(report: m.ThrustApplied) -> bool:
    """Whether none is, because of the STOP: on a busy machine thrust may end for another reason before."""
    return report.zero_cause is m.ZeroCause.NOT_ARMED and report.left == report.right == 0.0


def turns(side: float) -> Callable[[m.ThrustApplied], bool]:
    """Whether the fans turn the boat to that side: 1 to port, -1 to starboard."""
    return lambda report: side * (report.right - report.left) > TURNING


async def time_stops(boat: Boat, deck: Deck, count: int) -> tuple[list[float], int]:
    """From each press on the page to the report of zero [ms], and how many nothing followed.

    A boat that stands, as its advice may have it, is not pressed: there would be nothing to stop.
    """
    found_ms, unanswered = list[float](), 0
    for number in range(count):
        await boat.arm()
        try:
            await boat.until_applied(is_under_way, CLOCK.now_us(), UNDER_WAY_S)
        except TimeoutError:
            continue
        await asyncio.sleep(PHASE_S * (number % PHASES))
        pressed_us = await deck.press_stop()
        try:
            found_ms.append((await boat.until_applied(is_stopped, pressed_us, ANSWER_S) - pressed_us) * 1e-3)
        except TimeoutError:
            unanswered += 1
    return found_ms, unanswered


async def time_sticks(boat: Boat, deck: Deck, count: int) -> tuple[list[float], int]:
    """From each key on the page to the report of the turn it asks for [ms], and how many nothing followed.

    MANUAL ends where the page was silent for too long, as on a busy machine; then the wheel is taken again.
    """
    await boat.arm()
    await deck.take_wheel()
    found_ms, unanswered = list[float](), 0
    for number in range(count):
        await asyncio.sleep(0.5 + PHASE_S * (number % PHASES))
        code, side = (("KeyA", 1.0), ("KeyD", -1.0))[number % 2]
        pressed_us = await deck.press_key(code)
        try:
            at_us = await boat.until_applied(turns(side), pressed_us, ANSWER_S)
            found_ms.append((at_us - pressed_us) * 1e-3)
        except TimeoutError:
            unanswered += 1
            await deck.take_wheel()
        await deck.let_key_go(code)
    return found_ms, unanswered


async def measure_crowd(
    config: Config, boat: Boat, deck: Deck, clients: int, seconds: float, stops: int
) -> tuple[Crowd, list[float], int]:
    """The dashboard's processor time and the boat's decisions with so many clients besides the page, and its STOPs.

    Of those what `time_stops` returns.
    """
    async with crowd(page_origin(config), clients):
        await asyncio.sleep(1.0)
        before_s = await asyncio.to_thread(dashboard_cpu_s)
        decisions_hz = await boat.decisions_hz(seconds)
        used_s = await asyncio.to_thread(dashboard_cpu_s) - before_s
        stops_ms, unanswered = await time_stops(boat, deck, stops)
    return Crowd(clients=clients, cpu_cores=used_s / seconds, decisions_hz=decisions_hz), stops_ms, unanswered


async def watch_heap(browser: Browser, seconds: float) -> list[tuple[float, float]]:
    """Time [s] and heap [MiB] of a page that is left open, after the warm-up."""
    if seconds <= 0:
        return []
    deck, _ = await browser.open_page()
    begun_us, found = CLOCK.now_us(), list[tuple[float, float]]()
    while (at_s := (CLOCK.now_us() - begun_us) * 1e-6) < seconds:
        if at_s >= WARM_UP * seconds:
            found.append((at_s, await deck.heap_mib()))
        await asyncio.sleep(min(HEAP_PERIOD_S, seconds / 20))
    return found


def dashboard_cpu_s() -> float:
    """Processor time of the dashboard that this process has started [s]."""
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            words = (folder / "cmdline").read_text(encoding="utf-8").rstrip("\0").split("\0")
            if words[-1] == "dashboard" and str(os.getpid()) in words:
                fields = (folder / "stat").read_text(encoding="ascii").rpartition(")")[2].split()
                return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
        except OSError:  # it has just ended
            continue
    raise ProcessLookupError("no dashboard runs here")
