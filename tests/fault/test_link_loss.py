"""A scenario that cuts the link between board and host: the running boat stops, and goes on when the link is back."""

from __future__ import annotations

import asyncio
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from paani import keys
from paani import messages as m
from paani.authority import OBSERVER
from paani.bus import open_bus
from paani.clock import WallClock, stopwatch_ms
from paani.config import BusConfig, load_config
from tests.conftest import find_free_port

pytestmark = [pytest.mark.fault, pytest.mark.timeout(240)]

ZERO_S = 0.5
BACK_S = 5.0
LOST_S = 4.0
BY_LINK = {m.ZeroCause.PULSE_LOST, m.ZeroCause.TIMEOUT, m.ZeroCause.STALE_ECHO}
LOSSES_S = range(15, 150, 15)  # the first that finds the boat under way is looked at
BEFORE_S = 0.5
READY_S = 90.0
SCENARIO = (
    'seed = 14\n[world]\nkind = "lake"\nactors = false\nobstacles = false\n[weather]\nwind_mps = 1.0\n'
    "[route]\nfrom_m = 40.0\nlength_m = 150.0\n"
) + "".join(f'[[faults]]\nkind = "link_loss"\nstart_s = {at_s}.0\nduration_s = {LOST_S}\n' for at_s in LOSSES_S)


@pytest.fixture
def bus_config(tmp_path: Path) -> Iterator[BusConfig]:
    """Of a `paani up` in the scenario."""
    scenario = tmp_path / "cut.toml"
    scenario.write_text(SCENARIO)
    sets = (
        f"bus.router=tcp/127.0.0.1:{find_free_port()}",
        f"bus.runtime_dir={tmp_path / 'runtime'}",
        "advisor.evidence_max_age_s=3.0",  # what stops the boat is the link, not the age of the last picture
    )
    words = [word for setting in sets for word in ("--set", setting)]
    with (tmp_path / "out").open("w+") as output:
        supervisor = subprocess.Popen(
            [sys.executable, "-m", "paani", "up", "--headless", "--world", str(scenario), *words],
            stdout=output, stderr=subprocess.STDOUT, text=True,
        )  # fmt: skip
        try:
            deadline_ms = stopwatch_ms() + READY_S * 1e3
            while "alive after" not in (console := (tmp_path / "out").read_text()):
                assert supervisor.poll() is None, console
                assert stopwatch_ms() < deadline_ms, console
                threading.Event().wait(0.1)
            yield load_config(sets=sets).bus
        finally:
            supervisor.terminate()
            supervisor.wait(5)
            print((tmp_path / "out").read_text())


class Watch:
    """What the thrust adapter applies and what the board orders, by the plant's simulated time."""

    def __init__(self) -> None:
        self.applied: list[m.ThrustApplied] = []
        self.poses: list[m.TruePose] = []
        self.commands: list[m.NavCommand] = []

    @property
    def sim_s(self) -> float:
        return self.poses[-1].sim_us * 1e-6 if self.poses else 0.0

    def forces(self) -> list[tuple[float, float, m.ZeroCause]]:
        """Simulated time [s], force [N] and why it is zero: of the steps whose truth was published with it."""
        at_s = {pose.source_us: pose.sim_us * 1e-6 for pose in self.poses}
        return [(at_s[a.source_us], a.left_n + a.right_n, a.zero_cause) for a in self.applied if a.source_us in at_s]

    def under_way(self, from_s: float, to_s: float) -> bool:
        found = [force for at_s, force, _ in self.forces() if from_s <= at_s < to_s]
        return len(found) > 5 and all(force > 0.0 for force in found)


async def test_a_lost_link_stops_the_running_boat(bus_config: BusConfig) -> None:
    """W4, W6: no thrust and no pulse of the board arrives; the board itself orders nothing without the host's time."""
    bus = await open_bus(bus_config, OBSERVER, WallClock())
    watch = Watch()
    bus.on(keys.THRUST_APPLIED, watch.applied.append)
    bus.on(keys.TRUE_POSE, watch.poses.append)
    bus.on(keys.COMMAND, watch.commands.append)
    try:
        lost_s = await first_loss_under_way(watch)
        while watch.sim_s < lost_s + LOST_S + BACK_S:
            await asyncio.sleep(0.1)
    finally:
        await bus.close()

    during = [force for force in watch.forces() if lost_s <= force[0] < lost_s + LOST_S]
    zero_s = next(at_s for at_s, force, _ in during if force == 0.0) - lost_s
    back_s = next(at_s for at_s, force, _ in watch.forces() if at_s > lost_s + LOST_S and force > 0.0) - lost_s - LOST_S
    print(f"zero after {zero_s:.2f} s, thrust again {back_s:.2f} s after the link was back")
    assert zero_s <= ZERO_S
    late = [(force, cause) for at_s, force, cause in during if at_s > lost_s + ZERO_S]
    assert len(late) > 50
    assert {force for force, _ in late} == {0.0}
    causes = {cause for _, cause in late}
    assert causes & BY_LINK
    assert causes <= BY_LINK | {m.ZeroCause.ARMING_LOST}  # the operator's word, on the host, may be late on its own
    assert back_s <= BACK_S
    assert any(m.Inhibit.NO_CLOCK in command.inhibits for command in watch.commands)


async def first_loss_under_way(watch: Watch) -> float:
    for at_s in LOSSES_S:
        while watch.sim_s < at_s:
            await asyncio.sleep(0.05)
        if watch.under_way(at_s - BEFORE_S, at_s):
            return float(at_s)
    pytest.fail("the boat never was under way")
