"""The sensors of the simulated boat on the bus."""

from __future__ import annotations

import asyncio

import pytest

from paani import keys
from tests.conftest import OpenAs, Spawn

pytestmark = pytest.mark.integration


async def test_what_a_boat_carries_is_on_the_bus(spawn: Spawn, open_as: OpenAs) -> None:
    """Vessels by AIS as it is, ranges and depths once it has a scanner and a sounder."""
    bus = await open_as("observer")
    scans, depths, ais = bus.latest(keys.SCAN), bus.latest(keys.DEPTH), bus.latest(keys.AIS)
    async with spawn("plant", "plant.sensors.lidar=true", "plant.sensors.sonar=true"), asyncio.timeout(20.0):
        scan, depth = await scans.next(), await depths.next()
        await ais.next()
    assert len(scan.ranges_m) == 360
    assert depth.available
    assert depth.depth_m > 0.3
    received = scans.received, depths.received
    async with spawn("plant"), asyncio.timeout(20.0):
        await ais.next()
        await ais.next()
    assert (scans.received, depths.received) == received
