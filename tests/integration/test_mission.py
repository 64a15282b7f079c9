"""The navigator's process with a mission and a fence: published, followed, and refused before it starts."""

from __future__ import annotations

import asyncio
import subprocess
import sys
from pathlib import Path

import pytest

from paani import keys
from paani import messages as m
from paani.clock import WallClock
from tests.conftest import OpenAs, Spawn

pytestmark = pytest.mark.integration
CLOCK = WallClock()

ROUTE = 'name = "a"\n[[waypoints]]\nx_m = 0\ny_m = 0\n[[waypoints]]\nx_m = 60\ny_m = 0\n'
MISSION = 'name = "there"\n[[legs]]\ndo = "hold_station"\nduration_s = 0.5\n[[legs]]\ndo = "follow_route"\n'
FENCE = (
    '[[areas]]\nkeep = "in"\n'
    "corners = [{x_m = -20, y_m = -20}, {x_m = EAST, y_m = -20}, {x_m = EAST, y_m = 20}, {x_m = -20, y_m = 20}]\n"
)


def settings(folder: Path, east_m: float) -> tuple[str, ...]:
    files = {"route": ROUTE, "mission": MISSION, "fence": FENCE.replace("EAST", str(east_m))}
    for name, text in files.items():
        (folder / f"{name}.toml").write_text(text)
    return tuple(f"navigator.{name}={folder / f'{name}.toml'}" for name in files)


async def test_legs_follow_each_other_on_the_real_bus(spawn: Spawn, open_as: OpenAs, tmp_path: Path) -> None:
    """Held for half a second of simulated time, then under way; the mission is on the bus for late joiners."""
    plant, advisor, localization, operator, observer = [
        await open_as(name) for name in ("plant", "advisor", "localization", "dashboard", "observer")
    ]
    clock, advisory = plant.publisher(keys.SIM_TIME), advisor.publisher(keys.ADVISORY)
    odometry, arming = localization.publisher(keys.ODOMETRY), operator.publisher(keys.ARMING)
    orders, mission = observer.latest(keys.COMMAND), observer.latest(keys.MISSION)
    seen: list[tuple[int, tuple[m.Inhibit, ...]]] = []
    async with spawn("navigator", *settings(tmp_path, 100.0)), asyncio.timeout(30):
        sim_us = 0
        while not (seen and seen[-1] == (1, ())):
            now_us, sim_us = CLOCK.now_us(), sim_us + 50_000
            clock.put(m.SimTime(source_us=now_us, sim_us=sim_us, stamp_us=now_us))
            advisory.put(m.Advisory(source_us=now_us, direction=m.Direction.STRAIGHT, reason=m.Reason.CENTER_CLEAR))
            odometry.put(m.Odometry(source_us=now_us, x_m=1.0, y_m=0.0, yaw_rad=0.0, surge_mps=0.0, healthy=True))
            arming.put(m.Arming(source_us=now_us, armed=True))
            await asyncio.sleep(0.05)
            if orders.value is not None:
                seen.append((orders.value.leg_index, orders.value.inhibits))
        assert (0, (m.Inhibit.HOLDING,)) in seen
        assert mission.value is not None
        assert [leg.kind for leg in mission.value.legs] == [m.LegKind.HOLD_STATION, m.LegKind.FOLLOW_ROUTE]
        assert len(mission.value.fence) == 1


async def test_a_route_that_leaves_the_fence_stops_the_process_before_it_starts(
    tmp_path: Path, private_sets: tuple[str, ...], open_as: OpenAs
) -> None:
    await open_as("observer")
    words = [word for each in (*private_sets, *settings(tmp_path, 50.0)) for word in ("--set", each)]
    command = [sys.executable, "-m", "paani", "navigator", *words]
    done = await asyncio.to_thread(subprocess.run, command, capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "mission.toml: legs[1].waypoints[1]: is outside the fence" in done.stderr
