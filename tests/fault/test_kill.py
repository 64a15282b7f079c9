"""A process that dies, hangs or is cut off stops the boat within 0.5 s, and the loop comes back by itself."""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
import subprocess
import sys
import threading
from collections.abc import AsyncIterator, Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

from paani import keys
from paani import messages as m
from paani.authority import OBSERVER
from paani.bus import Bus, open_bus
from paani.clock import WallClock, stopwatch_ms
from paani.config import BusConfig, Config, load_config
from tests.arming import arm_on_page
from tests.conftest import find_free_port

pytestmark = [pytest.mark.fault, pytest.mark.timeout(90)]

ZERO_S = 0.5
BACK_S = 5.0
FROZEN_S = 1.5
READY_S = 90.0
STAYS_STOPPED_S = 1.5
SERVICES = (*keys.VITAL_SERVICES, "router", "plant")
CLOCK = WallClock()


class Loop(NamedTuple):
    supervisor: subprocess.Popen[str]
    bus: BusConfig
    page: str = ""


@pytest.fixture(scope="module")
def loop(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Loop]:
    """`paani up` on the river, one for all tests of this file."""
    folder = tmp_path_factory.mktemp("up")
    sets = (
        f"bus.router=tcp/127.0.0.1:{find_free_port()}",
        f"bus.runtime_dir={folder / 'runtime'}",
        f"dashboard.port={find_free_port()}",
    )
    words = [word for setting in sets for word in ("--set", setting)]
    with (folder / "out").open("w+") as output:
        supervisor = subprocess.Popen(
            [sys.executable, "-m", "paani", "up", "--world", "river", *words],
            stdout=output, stderr=subprocess.STDOUT, text=True,
        )  # fmt: skip
        try:
            deadline_ms = stopwatch_ms() + READY_S * 1e3
            while "alive after" not in (found := (folder / "out").read_text()):
                assert supervisor.poll() is None, found
                assert stopwatch_ms() < deadline_ms, found
                threading.Event().wait(0.1)
            config = load_config(sets=sets)
            yield Loop(supervisor, config.bus, f"http://127.0.0.1:{config.dashboard.port}")
            assert supervisor.poll() is None, "the supervisor itself ended"
        finally:
            supervisor.terminate()
            supervisor.wait(5)
            print((folder / "out").read_text())


class Watch:
    """What the thrust adapter applied, by its own stamps, and which services are alive."""

    def __init__(self, bus: Bus) -> None:
        self.applied: list[m.ThrustApplied] = []
        self.alive: dict[str, bool] = {}
        self.alive_us: dict[str, int] = {}
        bus.on(keys.THRUST_APPLIED, self.applied.append)

    async def follow(self, bus: Bus) -> None:
        async for service, alive in bus.alive_events():
            self.alive[service] = alive
            self.alive_us[service] = CLOCK.now_us()

    def moves_after(self, at_us: int) -> bool:
        return any(moves(report) and report.source_us > at_us for report in self.applied)


def moves(report: m.ThrustApplied) -> bool:
    return report.left_n + report.right_n > 0.0


@contextlib.asynccontextmanager
async def watching(loop: Loop) -> AsyncIterator[Watch]:
    bus = await open_bus(loop.bus, OBSERVER, CLOCK)
    watch = Watch(bus)
    following = asyncio.create_task(watch.follow(bus))
    yield watch
    following.cancel()
    await bus.close()


async def until(condition: Callable[[], bool], limit_s: float, what: str) -> None:
    try:
        async with asyncio.timeout(limit_s):
            while not condition():
                await asyncio.sleep(0.02)
    except TimeoutError:
        pytest.fail(f"not within {limit_s} s: {what}")


async def arm_by_hand(loop: Loop, watch: Watch) -> int:
    """When the operator armed on the page [us]; until then nothing may move, though every process is alive."""
    await until(lambda: watch.applied[-1].zero_cause is m.ZeroCause.NOT_ARMED, 5.0, "the operator heard again")
    back_us = CLOCK.now_us()
    await asyncio.sleep(STAYS_STOPPED_S)
    assert watch.applied[-1].zero_cause is m.ZeroCause.NOT_ARMED
    assert not watch.moves_after(back_us), "armed again by itself"
    await arm_on_page(loop.page, loop.bus, press=CLOCK.now_us())
    return CLOCK.now_us()


def pid_of(loop: Loop, service: str) -> int:
    """The process of that name whose parent is the supervisor."""
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            words = (folder / "cmdline").read_text().rstrip("\0").split("\0")
            parent = int((folder / "stat").read_text().rpartition(") ")[2].split()[1])
            if parent == loop.supervisor.pid and words[-1] == service:
                return int(folder.name)
    raise AssertionError(f"no process {service}")


def settled(watch: Watch) -> bool:
    now_us = CLOCK.now_us()
    return (
        all(watch.alive.get(service) for service in Config().services)
        and sum(moves(r) for r in watch.applied if r.source_us > now_us - 500_000) >= 8
    )


def stopped_after_s(service: str, applied: list[m.ThrustApplied], hit_us: int, back_us: int) -> float:
    """Seconds from the hit until no force was applied any more, while the process was away."""
    if service == "router":  # nobody hears the plant then: it tells afterwards when its zero began
        found = next(r for r in applied if r.source_us > hit_us + ZERO_S * 1e6)
        assert not moves(found)
        return (found.since_us - hit_us) * 1e-6
    if service == "plant":  # a dead plant applies nothing
        return (max(r.source_us for r in applied if moves(r) and r.source_us <= back_us) - hit_us) * 1e-6
    found = next(r for r in applied if r.source_us > hit_us and not moves(r))
    assert not any(moves(r) for r in applied if found.source_us < r.source_us <= hit_us + ZERO_S * 1e6)
    return (found.source_us - hit_us) * 1e-6


@pytest.mark.parametrize("service", SERVICES)
@pytest.mark.parametrize("hit", [signal.SIGKILL, signal.SIGSTOP], ids=["killed", "frozen"])
async def test_the_boat_stops_and_the_loop_comes_back(loop: Loop, service: str, hit: signal.Signals) -> None:
    """O2: without fresh orders from a living chain there is no thrust. Nothing but a hand arms again."""
    async with watching(loop) as watch:
        await until(lambda: settled(watch), 40.0, "everything alive and thrust applied")
        pid = pid_of(loop, service)
        os.kill(pid, hit)
        hit_us = CLOCK.now_us()
        if hit is signal.SIGSTOP:
            await asyncio.sleep(FROZEN_S)
            back_us = CLOCK.now_us()
            os.kill(pid, signal.SIGCONT)
        else:
            await until(lambda: watch.alive_us[service] > hit_us and not watch.alive[service], 5.0, "seen to be gone")
            await until(lambda: watch.alive[service], 30.0, f"{service} started again")
            back_us = watch.alive_us[service]
        if service in {"operator", "dashboard"} and hit is signal.SIGKILL:
            back_us = await arm_by_hand(loop, watch)
        await until(lambda: watch.moves_after(back_us), BACK_S, f"thrust after {service} came back")
        stopped_s = stopped_after_s(service, watch.applied, hit_us, back_us)
        moved_us = next(r.source_us for r in watch.applied if moves(r) and r.source_us > back_us)
        print(
            f"{service} {hit.name}: zero after {stopped_s:.2f} s, away {(back_us - hit_us) * 1e-6:.2f} s,"
            f" thrust again {(moved_us - back_us) * 1e-6:.2f} s later"
        )
        assert stopped_s <= ZERO_S
        if hit is signal.SIGSTOP:
            assert pid_of(loop, service) == pid, "a short freeze is no reason to kill"
