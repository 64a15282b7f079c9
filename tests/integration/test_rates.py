"""How often the estimator and the controller speak, by the wall clock."""

from __future__ import annotations

import asyncio

import pytest

from paani import keys
from paani import messages as m
from paani.clock import WallClock
from tests.at_work import at_work
from tests.conftest import OpenAs, Spawn

pytestmark = pytest.mark.integration
CLOCK = WallClock()
COUNTED_S = 3.0


@pytest.mark.parametrize("profile", ["paani", "paper"])
async def test_l1_l3_both_estimates_come_20_times_a_second(profile: str, spawn: Spawn, open_as: OpenAs) -> None:
    observer = await open_as("observer")
    inboxes = [observer.queue(topic, 1000) for topic in (keys.LOCAL_ODOMETRY, keys.ODOMETRY)]
    async with spawn("localization", f"profile={profile}"):
        for inbox in inboxes:
            inbox.drain()
        await asyncio.sleep(COUNTED_S)
        counts = [len(inbox.drain()) for inbox in inboxes]
    assert [count / COUNTED_S for count in counts] == pytest.approx([20.0, 20.0], abs=2.0)


@pytest.mark.parametrize("profile", ["paani", "paper"])
async def test_n1_thrust_comes_10_times_a_second_and_goes_on_without_orders(
    profile: str, spawn: Spawn, open_as: OpenAs
) -> None:
    """N1: each order is answered; without one the controller steps by itself, a little less often."""
    thrust = (await open_as("observer")).queue(keys.THRUST, 1000)
    orders = (await open_as("navigator")).publisher(keys.COMMAND)

    async def order() -> None:
        while True:
            orders.put(m.NavCommand(source_us=CLOCK.now_us(), enable=False, heading_rad=0.0, speed_mps=0.0))
            await asyncio.sleep(0.1)

    async def count_hz() -> float:
        thrust.drain()
        await asyncio.sleep(COUNTED_S)
        return len(thrust.drain()) / COUNTED_S

    async with spawn("controller", f"profile={profile}"):
        assert 6.0 < await count_hz() < 7.5
        async with at_work(order()):
            assert await count_hz() == pytest.approx(10.0, abs=1.0)
