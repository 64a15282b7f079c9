"""The navigator's process with a mission and a fence: published, followed, and refused before it starts."""

from __future__ import annotations

import asyncio
import json
import subprocess
import sys
from pathlib import Path

import pytest

from paani import keys
from paani import messages as m
from paani.bus import Bus
from paani.clock import WallClock
from tests.conftest import OpenAs, Spawn
from tests.paani_command import paani

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


class InputPublishers:
    """Publishes everything that the navigator receives, and collects its orders."""

    def __init__(self, buses: dict[str, Bus]) -> None:
        self.clock = buses["plant"].publisher(keys.SIM_TIME)
        self.advisory = buses["advisor"].publisher(keys.ADVISORY)
        self.odometry = buses["localization"].publisher(keys.ODOMETRY)
        self.arming = buses["operator"].publisher(keys.ARMING)
        self.orders = buses["observer"].latest(keys.COMMAND)
        self.mission = buses["observer"].latest(keys.MISSION)
        self.sim_us = 0

    async def until_under_way(self) -> list[int]:
        """The leg of each order, up to the first order that moves the boat."""
        legs: list[int] = []
        while True:
            now_us, self.sim_us = CLOCK.now_us(), self.sim_us + 50_000
            self.clock.put(m.SimTime(source_us=now_us, sim_us=self.sim_us, stamp_us=now_us))
            advisory = m.Advisory(source_us=now_us, direction=m.Direction.STRAIGHT, reason=m.Reason.CENTER_CLEAR)
            self.advisory.put(advisory)
            here = m.Odometry(source_us=now_us, x_m=1.0, y_m=0.0, yaw_rad=0.0, surge_mps=0.0, healthy=True)
            self.odometry.put(here)
            self.arming.put(m.Arming(source_us=now_us, armed=True))
            await asyncio.sleep(0.05)
            order = self.orders.value
            if order is not None and order.source_us > now_us - 500_000:
                legs.append(order.leg_index)
                if order.enable:
                    return legs


BUSES = ("plant", "advisor", "localization", "operator", "observer")


async def test_legs_follow_each_other_on_the_bus(spawn: Spawn, open_as: OpenAs, tmp_path: Path) -> None:
    """The boat holds its station for half a second of simulated time, then follows its route; both are published."""
    inputs = InputPublishers({name: await open_as(name) for name in BUSES})
    async with spawn("navigator", *settings(tmp_path, 100.0)), asyncio.timeout(30):
        legs = await inputs.until_under_way()
    assert (legs[0], legs[-1]) == (0, 1)
    mission = inputs.mission.value
    assert mission is not None
    assert [leg.kind for leg in mission.legs] == [m.LegKind.HOLD_STATION, m.LegKind.FOLLOW_ROUTE]
    assert len(mission.fence) == 1


async def test_a_navigator_restarted_under_way_goes_on_with_its_leg(
    spawn: Spawn, open_as: OpenAs, tmp_path: Path
) -> None:
    """The station is not held again; with a new run of the operator's process the mission begins anew."""
    buses = {name: await open_as(name) for name in BUSES}
    inputs, sets = InputPublishers(buses), settings(tmp_path, 100.0)
    async with spawn("navigator", *sets), asyncio.timeout(30):
        await inputs.until_under_way()
    await asyncio.sleep(0.6)
    async with spawn("navigator", *sets), asyncio.timeout(30):
        assert set(await inputs.until_under_way()) == {1}
    await buses["operator"].close()
    await asyncio.sleep(0.6)
    anew = InputPublishers({**buses, "operator": await open_as("operator")})
    anew.sim_us = inputs.sim_us
    async with spawn("navigator", *sets), asyncio.timeout(30):
        assert (await anew.until_under_way())[0] == 0


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


async def test_land_of_the_files_outlasts_every_mission_that_is_sent(
    spawn: Spawn, open_as: OpenAs, tmp_path: Path, private_sets: tuple[str, ...]
) -> None:
    land, across, beside = tmp_path / "land.geojson", tmp_path / "across.toml", tmp_path / "beside.toml"
    ring = [[9.2004, 47.6499], [9.2006, 47.6499], [9.2006, 47.6501], [9.2004, 47.6499]]
    land.write_text(json.dumps({"type": "Polygon", "coordinates": [ring]}))
    across.write_text(ROUTE)
    beside.write_text(ROUTE.replace("x_m = 60\ny_m = 0", "x_m = 0\ny_m = 30").replace('"a"', '"beside"'))
    send = ("mission", "send", "--no-fence")
    mission = 'name = "%s"\n[[legs]]\ndo = "follow_route"\nroute = "%s"\n'
    (tmp_path / "across_mission.toml").write_text(mission % ("across", across.name))
    (tmp_path / "beside_mission.toml").write_text(mission % ("beside", beside.name))
    missions = (await open_as("observer")).latest(keys.MISSION)
    sets = (f"navigator.land={land}", "localization.origin_lat_lon_deg=[47.65, 9.2]")
    async with spawn("operator"), spawn("navigator", *sets), asyncio.timeout(40):
        assert [area.name for area in (await missions.next()).land] == ["land"]
        refused = await paani(private_sets, *send, str(tmp_path / "across_mission.toml"))
        assert refused == (2, "", "paani: refused: legs[0].waypoints[0]: the leg to the next crosses land\n")
        assert (await paani(private_sets, *send, str(tmp_path / "beside_mission.toml")))[0] == 0
        while (taken := await missions.next()).name != "beside":
            pass
        assert len(taken.land) == 1
    land.write_text(json.dumps({"type": "Polygon", "coordinates": [ring[:-1]]}))
    words = [word for each in (*private_sets, *sets) for word in ("--set", each)]
    command = [sys.executable, "-m", "paani", "navigator", *words]
    done = await asyncio.to_thread(subprocess.run, command, capture_output=True, text=True, check=False, timeout=60)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert f"navigator.land {land}: coordinates[0]: is not closed by its first position" in done.stderr


async def test_a_mission_that_is_sent_is_followed_a_bad_one_is_not_and_a_restart_forgets_neither(
    spawn: Spawn, open_as: OpenAs, tmp_path: Path, private_sets: tuple[str, ...]
) -> None:
    sets = settings(tmp_path, 100.0)
    sent, far = tmp_path / "sent.toml", tmp_path / "far.toml"
    sent.write_text('name = "sent"\n[[legs]]\ndo = "hold_station"\nx_m = 5.0\ny_m = 5.0\n')
    far.write_text('name = "far"\n[[legs]]\ndo = "hold_station"\nx_m = 500.0\ny_m = 5.0\n')
    missions = (await open_as("observer")).latest(keys.MISSION)

    async def followed(name: str) -> m.Mission:
        async with asyncio.timeout(20):
            while (mission := await missions.next()).name != name:
                pass
        return mission

    async with spawn("operator"):
        async with spawn("navigator", *sets):
            fence = (await followed("there")).fence
            assert await paani(private_sets, "mission", "send", str(sent)) == (0, "sent: 1 legs, in force\n", "")
            taken = await followed("sent")
            assert taken.fence == fence, "the fence of the files stays"
            refused = await paani(private_sets, "mission", "send", str(far))
            assert refused == (2, "", "paani: refused: legs[0].waypoints[0]: is outside the fence\n")
            assert (await missions.next()).accepted_us == taken.accepted_us > 0
        async with spawn("navigator", *sets):
            assert (await followed("sent")).accepted_us == taken.accepted_us
