"""Modes with real processes: a hand drives the boat, its death is zero thrust, and the boat comes home."""

from __future__ import annotations

import asyncio
import contextlib
import math
import sys
from collections.abc import AsyncIterator, Callable

import pytest

from paani import keys
from paani import messages as m
from paani.bus import Bus
from paani.clock import WallClock
from paani.messages import DriveMode, ModeRefusal
from paani.operator_client import OperatorClient
from tests.at_work import at_work
from tests.conftest import OpenAs, Spawn

pytestmark = [pytest.mark.integration, pytest.mark.timeout(120)]
CLOCK = WallClock()
SERVICES = ("operator", "navigator", "controller", "localization", "plant")
SETS = (
    'plant.adapter.require_pulses=["navigator","controller","localization","operator","dashboard"]',
    "navigator.planner.use=false",  # there are no pictures
    "navigator.route=''",
)
LET_GO_S = 0.5
AWAY_M = 2.5


class Lookout:
    """Says that the water is clear, and keeps what the plant reports."""

    def __init__(self, advisor: Bus, observer: Bus) -> None:
        self._advice = advisor.publisher(keys.ADVISORY)
        self._applied = observer.latest(keys.THRUST_APPLIED)
        self.pose, self.command = observer.latest(keys.TRUE_POSE), observer.latest(keys.COMMAND)
        self.reports: list[m.ThrustApplied] = []

    async def advise_forever(self) -> None:
        clear = m.LaneRisk(blocked=False)
        while True:
            advisory = m.Advisory(
                source_us=CLOCK.now_us(), direction=m.Direction.STRAIGHT, reason=m.Reason.CENTER_CLEAR,
                left=clear, center=clear, right=clear,
            )  # fmt: skip
            self._advice.put(advisory)
            await asyncio.sleep(0.1)

    async def keep_reports(self) -> None:
        while True:
            self.reports.append(await self._applied.next())

    @property
    def is_thrusting(self) -> bool:
        return bool(self.reports) and (self.reports[-1].left, self.reports[-1].right) != (0.0, 0.0)

    def distance_m(self, other: m.TruePose) -> float:
        here = self.pose.value
        assert here is not None
        return math.hypot(here.x_m - other.x_m, here.y_m - other.y_m)

    async def until(self, condition: Callable[[], bool], what: str) -> None:
        try:
            async with asyncio.timeout(25):
                while not condition():
                    await asyncio.sleep(0.02)
        except TimeoutError:
            pytest.fail(f"not within 25 s: {what}; {self.command.value} {self.reports[-1:]} {self.pose.value}")


@pytest.fixture
async def lookout(open_as: OpenAs) -> AsyncIterator[Lookout]:
    lookout = Lookout(await open_as("advisor"), await open_as("observer"))
    async with at_work(lookout.advise_forever(), lookout.keep_reports()):
        yield lookout


async def test_a_hand_drives_its_death_stops_the_boat_and_the_boat_comes_home(
    spawn: Spawn, open_as: OpenAs, lookout: Lookout, private_sets: tuple[str, ...]
) -> None:
    page = await open_as(keys.STATION)
    async with contextlib.AsyncExitStack() as stack:
        stack.enter_context(page.alive())
        await asyncio.gather(*(stack.enter_async_context(spawn(service, *SETS)) for service in SERVICES))
        hand = OperatorClient(page, CLOCK)
        await lookout.until(lambda: _is_barred(hand, DriveMode.HOLD) is False, "a position")
        assert await hand.set_mode(DriveMode.MANUAL, 5.0) is ModeRefusal.NOT_ARMED
        assert await hand.set_mode(DriveMode.ROUTE, 5.0) is ModeRefusal.NO_MISSION
        assert await hand.set_mode(DriveMode.RETURN, 5.0) is ModeRefusal.NO_HOME
        assert await hand.set_mode(DriveMode.IDLE, 5.0) is ModeRefusal.NONE
        assert await hand.hold_to_arm() is m.ArmRefusal.NONE
        await lookout.until(lambda: lookout.reports[-1].zero_cause is m.ZeroCause.NOT_ENABLED, "armed and idle")

        other = await asyncio.create_subprocess_exec(
            *(sys.executable, "-m", "tests.integration.hand_at_the_wheel", *private_sets),
            stdout=asyncio.subprocess.PIPE,
        )
        try:
            assert other.stdout is not None
            answers = [(await other.stdout.readline()).decode().strip() for _ in range(3)]
            assert answers == ["NOT_HOLDER", "NONE", "NONE"]
            begun = lookout.pose.value
            assert begun is not None
            await lookout.until(lambda: lookout.distance_m(begun) > AWAY_M, "driven away by hand")
            assert lookout.is_thrusting
        finally:
            killed_us = CLOCK.now_us()
            other.kill()
            await other.wait()
        await lookout.until(lambda: not lookout.is_thrusting, "zero thrust")
        first_zero = next(
            each for each in lookout.reports if each.sent_us > killed_us and (each.left, each.right) == (0.0, 0.0)
        )
        assert (first_zero.sent_us - killed_us) * 1e-6 <= LET_GO_S
        count = len(lookout.reports)
        await asyncio.sleep(1.0)
        assert all((each.left, each.right) == (0.0, 0.0) for each in lookout.reports[count:])
        assert hand.state is not None
        assert (hand.state.mode, hand.state.armed) == (DriveMode.IDLE, True)

        assert await hand.set_mode(DriveMode.RETURN, 5.0) is ModeRefusal.NOT_HOLDER
        assert await hand.take_wheel(5.0) is ModeRefusal.NONE
        assert await hand.set_mode(DriveMode.RETURN, 5.0) is ModeRefusal.NONE
        await lookout.until(lambda: _is_leg(lookout, "return home") and lookout.is_thrusting, "on the way home")
        farthest_m = lookout.distance_m(begun)
        await lookout.until(lambda: lookout.distance_m(begun) < farthest_m - 0.3, "nearer to home")
        assert await hand.set_mode(DriveMode.HOLD, 5.0) is ModeRefusal.NONE
        await lookout.until(lambda: _is_leg(lookout, "hold station") and not lookout.is_thrusting, "on station")
        assert lookout.command.value is not None
        assert lookout.command.value.inhibits == (m.Inhibit.HOLDING,)


def _is_barred(hand: OperatorClient, mode: DriveMode) -> bool | None:
    """None before the operator's process is heard."""
    return None if hand.state is None else any(bar.mode is mode for bar in hand.state.barred)


def _is_leg(lookout: Lookout, words: str) -> bool:
    return lookout.command.value is not None and lookout.command.value.leg == words
