"""How often the estimator and the controller send, by the stamps of what they send."""

from __future__ import annotations

import asyncio
import itertools
import statistics
from typing import Any

import pytest

from paani import keys
from paani import messages as m
from paani.bus import Queue
from paani.clock import WallClock
from tests.at_work import at_work
from tests.conftest import OpenAs, Spawn

pytestmark = pytest.mark.integration
CLOCK = WallClock()


async def usual_gap_us(inbox: Queue[Any], count: int) -> float:
    """The median time between two messages, which a busy machine changes least."""
    inbox.drain()
    async with asyncio.timeout(60):
        sent_us: list[int] = [(await inbox.get()).sent_us for _ in range(count)]
    return statistics.median(after - before for before, after in itertools.pairwise(sent_us))


@pytest.mark.parametrize("profile", ["paani", "paper"])
async def test_l1_l3_both_estimates_come_20_times_a_second(profile: str, spawn: Spawn, open_as: OpenAs) -> None:
    observer = await open_as("observer")
    inboxes = [observer.queue(topic, 1000) for topic in (keys.LOCAL_ODOMETRY, keys.ODOMETRY)]
    async with spawn("localization", f"profile={profile}"):
        gaps_us = [await usual_gap_us(inbox, 40) for inbox in inboxes]
    assert gaps_us == pytest.approx([50_000, 50_000], rel=0.1)


@pytest.mark.parametrize("profile", ["paani", "paper"])
async def test_n1_thrust_comes_10_times_a_second_and_goes_on_without_orders(
    profile: str, spawn: Spawn, open_as: OpenAs
) -> None:
    """Each order is answered; without one the controller steps by itself, half a period later."""
    thrust = (await open_as("observer")).queue(keys.THRUST, 1000)
    orders = (await open_as("navigator")).publisher(keys.COMMAND)

    async def order() -> None:
        while True:
            orders.put(m.NavCommand(source_us=CLOCK.now_us(), enable=False, heading_rad=0.0, speed_mps=0.0))
            await asyncio.sleep(0.1)

    async with spawn("controller", f"profile={profile}"):
        assert await usual_gap_us(thrust, 20) == pytest.approx(150_000, rel=0.1)
        async with at_work(order()):
            assert await usual_gap_us(thrust, 20) == pytest.approx(100_000, rel=0.1)
