"""Every process killed, and what else the bench can do to a drive: it stops in time, and comes back."""

from __future__ import annotations

import pytest

from paani_tools.bench.faults.drives import driving, faults_of, missing
from paani_tools.bench.faults.fault import Drive
from paani_tools.bench.faults.measure import keeps_bars, measure

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
    [Drive.PLAIN, pytest.param(Drive.CLOCK, marks=pytest.mark.long), pytest.param(Drive.LINK, marks=pytest.mark.long)],
)
@pytest.mark.timeout(400)
async def test_each_fault_once(drive: Drive) -> None:
    """O2: without fresh orders from a living chain there is no thrust. Nothing but a hand arms again."""
    if reason := missing(drive):
        pytest.skip(reason)
    bad = []
    async with driving(drive) as (loop, faults):
        for name in chosen(drive):
            run = await measure(faults[name], loop)
            print(run)
            if not keeps_bars(faults[name], run):
                bad.append(run)
    assert bad == []
