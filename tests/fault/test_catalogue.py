"""Every process killed, and what else the bench can do to a drive: it stops in time, and comes back."""

from __future__ import annotations

import pytest

from paani_tools.bench.faults.drives import driving, faults_of, missing
from paani_tools.bench.faults.fault import Drive
from paani_tools.bench.faults.measure import keeps_bars, measure

pytestmark = [pytest.mark.fault, pytest.mark.timeout(150)]

# Others that do not run for a second are left to `make test-long`: a killed one is the harder case.
OF_A_LONG_TEST = {fault.name for fault in faults_of(Drive.PLAIN) if fault.name.endswith(("not running", "memory"))} | {
    "clock set ahead by an hour"
}
ALWAYS = {"perception refused memory", "router not running", "plant not running", "controller not running"}


def chosen(drive: Drive) -> list[str]:
    return [fault.name for fault in faults_of(drive) if fault.name not in OF_A_LONG_TEST - ALWAYS]


@pytest.mark.parametrize("drive", list(Drive))
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
