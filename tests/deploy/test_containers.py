"""Both compose files on a real engine: driven, hurt and taken down."""

from __future__ import annotations

import asyncio
import os
import signal
import subprocess
from pathlib import Path

import pytest

from paani import messages as m
from paani.keys import BUTTON, PORTS, Graph
from paani.sides import Side, services_on
from tests.conftest import find_free_port
from tests.deploy.doors import Doors
from tests.deploy.engine import Engine
from tests.deploy.river import afloat, build, driving

pytestmark = [pytest.mark.deploy, pytest.mark.timeout(900)]

ZERO_S = 0.5
BOARD_RSS_MIB = 350.0
SPEED_MPS = 0.2  # at least, over the whole drive


@pytest.mark.parametrize("driven_s", [8.0, pytest.param(60.0, marks=pytest.mark.long)])
async def test_the_river_driven_by_board_and_host_in_containers(engine: Engine, driven_s: float) -> None:
    async with driving(engine) as drive:
        await asyncio.to_thread(check_confinement, engine, {*PORTS, BUTTON})
        await drive.await_under_way()
        begin_m = drive.distance_m
        decisions = drive.decisions
        await asyncio.sleep(driven_s)
        driven_m = drive.distance_m - begin_m
        rate_hz = (drive.decisions - decisions) / driven_s
        rss_mib = await asyncio.to_thread(board_rss_mib, engine)
        lights = await drive.mcu.read_lights()
        assert drive.bridge is not None
        arrow = drive.bridge.display
        perception = await asyncio.to_thread(engine.service_process, engine.container("board", "perception"))
        killed = await drive.fault(lambda: os.kill(perception, signal.SIGKILL), 0.0, lambda: None)
        cable = await asyncio.to_thread(engine.cable, engine.container("host", "router"), "paani-host_link")
        cut = await drive.fault(lambda: switch(cable, "down"), 4.0, lambda: switch(cable, "up"))
        print(f"{driven_m:.1f} m in {driven_s:.0f} s, {rate_hz:.1f} decisions/s, arrow {arrow}; board [MiB] {rss_mib}")
        print(f"perception killed: zero thrust after {killed[0]:.2f} s, thrust after {killed[1]:.2f} s")
        print(f"link cut for 4 s: zero thrust after {cut[0]:.2f} s, thrust {cut[1]:.2f} s after its return")
        assert driven_m >= SPEED_MPS * driven_s
        assert drive.collisions == 0
        assert rate_hz >= 2.0
        assert arrow is not m.Direction.NO_DATA
        assert any(set(row) != {"0"} for row in lights)
        assert killed[0] <= ZERO_S
        assert cut[0] <= ZERO_S
        assert sum(rss_mib.values()) <= BOARD_RSS_MIB
    assert not engine.containers("board") + engine.containers("host")


@pytest.mark.long
async def test_ports_speak_at_doors_of_this_machine_alone(engine: Engine) -> None:
    """Of a boat adrift, to programs of others; none of them may command it from there."""
    await asyncio.to_thread(build, engine, "ports")
    doors = Doors()
    page = {"PAANI_PAGE_PORT": str(find_free_port())}
    async with afloat(engine, "sim,ports", {**doors.environment, **page}):
        await asyncio.to_thread(check_confinement, engine, {"recorder", "bridge", BUTTON})
        await doors.require_all_speak()


def check_confinement(engine: Engine, idle: set[str]) -> None:
    """What runs where, all but `idle`, and what it may."""
    networks = {}
    for side in (Side.BOARD, Side.HOST):
        containers = engine.containers(side)
        names = {each["Config"]["Labels"]["com.docker.compose.service"] for each in containers}
        assert names == set(services_on(side, Graph.SIMULATION)) - idle
        networks[side] = {name for each in containers for name in each["NetworkSettings"]["Networks"]}
        for each in containers:
            host, name = each["HostConfig"], each["Name"]
            open_to = {door["HostIp"] for doors in (host["PortBindings"] or {}).values() for door in doors}
            assert side is Side.BOARD or open_to <= {"127.0.0.1"}, name
            assert each["State"]["Health"]["Status"] == "healthy", name
            assert each["Config"]["User"] == "paani", name
            assert host["ReadonlyRootfs"], name
            assert host["Memory"] > 0, name
            assert host["NanoCpus"] > 0, name
            assert host["PidsLimit"] > 0, name
            assert host["CapDrop"] == ["ALL"], name
            assert host["SecurityOpt"] == ["no-new-privileges"], name
            assert host["LogConfig"]["Config"]["max-size"], name
            assert not [word for word in each["Config"]["Env"] if "PASSWORD" in word.upper()], name
    assert not networks[Side.BOARD] & networks[Side.HOST]


def board_rss_mib(engine: Engine) -> dict[str, float]:
    """Resident memory of each container of the board, shared pages counted in every process [MiB]."""
    found = {}
    for each in engine.containers("board"):
        statuses = [
            Path(f"/proc/{pid}/status").read_text(encoding="ascii")
            for pid in engine.processes(each["Name"].removeprefix("/"))
        ]
        kib = [int(line.split()[1]) for status in statuses for line in status.splitlines() if line.startswith("VmRSS")]
        found[each["Config"]["Labels"]["com.docker.compose.service"]] = round(sum(kib) / 1024, 1)
    return found


def switch(cable: str, state: str) -> None:
    """Pull out the host's router's cable to the board, or put it in, at once, as no command of the engine."""
    subprocess.run(["ip", "link", "set", cable, state], check=True)
