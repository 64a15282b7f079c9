"""Every process killed, and what else the bench can do to a drive: it stops in time, and comes back."""

from __future__ import annotations

import asyncio

import pytest

from paani import keys
from paani import messages as m
from paani.operator_client import OperatorClient
from paani_tools.bench.faults.drives import driving, faults_of, missing
from paani_tools.bench.faults.fault import Drive
from paani_tools.bench.faults.inputs import flood
from paani_tools.bench.faults.measure import keeps_bars, measure
from paani_tools.bench.faults.running import MONOTONIC, Loop
from tests.firmware.emulator import build_image

pytestmark = [pytest.mark.fault, pytest.mark.timeout(150)]

# CI's part of the catalogue; `make test-long` has all of it, 20 times, and tests/link has a cut of the link.
ALSO = {
    "black picture",
    "perception refused memory",
    "router not running",
    "plant not running",
    "controller not running",
}
LATER = ("not running", "memory", "picture", "link")


def chosen(drive: Drive) -> list[str]:
    return [fault.name for fault in faults_of(drive) if fault.name in ALSO or not fault.name.endswith(LATER)]


@pytest.mark.parametrize(
    "drive",
    [drive if drive is Drive.PLAIN else pytest.param(drive, marks=pytest.mark.long) for drive in Drive],
)
@pytest.mark.timeout(400)
async def test_each_fault_once(drive: Drive) -> None:
    """O2: without fresh orders from a living chain there is no thrust. Nothing but a hand arms again."""
    if drive is Drive.SERIAL:
        await asyncio.to_thread(build_image)
    if reason := missing(drive):
        pytest.skip(reason)
    bad = []
    async with driving(drive) as (loop, faults):
        for name in chosen(drive):
            run = await measure(faults[name], loop)
            print(run)
            if not keeps_bars(faults[name], run):
                bad.append(run)
        if drive is Drive.PLAIN:
            await stays_still_under_a_flood(loop)
    assert bad == []


async def stays_still_under_a_flood(loop: Loop) -> None:
    """Whatever anybody but the operator's process says with its own credentials, a stopped boat has no thrust.

    What that process says to the thrust adapter arms, whoever says it; and the adapter's word is what is looked at.
    """
    async with loop.joined("stop") as bus:
        assert await OperatorClient(bus, loop.clock).stop(2.0)
    await asyncio.sleep(0.5)
    begun_us = MONOTONIC.now_us()
    sent = await flood(loop, 100, refused=False, spared={keys.ARMING.name, keys.THRUST_APPLIED.name})
    await asyncio.sleep(1.0)
    reports = [report for report in loop.watch.reports if report.at_us > begun_us]
    print(f"{sent} hostile messages, {len(reports)} reports")
    assert sent > 3000
    assert len(reports) > 20
    assert {(report.moves, report.cause) for report in reports} == {(False, m.ZeroCause.NOT_ARMED)}
