"""A drive of one's own to hurt: `paani up` with a bus, a runtime folder and settings that nobody else has."""

from __future__ import annotations

import asyncio
import contextlib
import http.client
import os
import signal
import socket
import sys
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import msgspec

from paani import keys
from paani import messages as m
from paani.authority import OBSERVER
from paani.bus import Bus, open_bus
from paani.clock import MonotonicClock, WallClock
from paani.config import Config, load_config
from paani.errors import UserError
from paani.operator_key import ensure_operator_key

MONOTONIC = MonotonicClock()
HOLD_S, REFRESH_S = 1.3, 0.15
START_S, STOP_S, SETTLE_S = 90.0, 10.0, 40.0
POLL_S = 0.02
MOVING_S, MOVING_REPORTS = 0.5, 8  # of 10: under way
ALIVE = "alive after"


class ShiftedClock:
    """The wall clock as the drive's processes see it, where a fault has set it."""

    def __init__(self) -> None:
        self._wall, self.shift_us = WallClock(), 0

    def now_us(self) -> int:
        return self._wall.now_us() + self.shift_us


class Report(NamedTuple):
    """What the thrust adapter reported: heard at [us, monotonic]; by its own clock, when and since when."""

    at_us: int
    moves: bool
    cause: m.ZeroCause
    source_us: int
    since_us: int


class Watch:
    """What is heard of the drive by somebody who only looks."""

    def __init__(self, bus: Bus) -> None:
        self.reports: list[Report] = []
        self.decided_us: list[int] = []
        self.sim_s = 0.0
        self.alive: dict[str, bool] = {}
        self.changed_us: dict[str, int] = {}
        bus.on(keys.THRUST_APPLIED, self._hear_applied)
        bus.on(keys.EVIDENCE, self._hear_evidence)
        bus.on(keys.TRUE_POSE, self._hear_pose)

    def _hear_applied(self, applied: m.ThrustApplied) -> None:
        moves = applied.left_n != 0.0 or applied.right_n != 0.0
        heard = (MONOTONIC.now_us(), moves, applied.zero_cause, applied.source_us, applied.since_us)
        self.reports.append(Report(*heard))

    def _hear_evidence(self, evidence: m.Evidence) -> None:
        self.decided_us.append(MONOTONIC.now_us())

    def _hear_pose(self, pose: m.TruePose) -> None:
        self.sim_s = pose.sim_us * 1e-6

    async def follow(self, bus: Bus) -> None:
        """Who is alive, until cancelled."""
        async for service, alive in bus.alive_events():
            self.alive[service], self.changed_us[service] = alive, MONOTONIC.now_us()


class Side(NamedTuple):
    """Options and settings of one `paani up`."""

    options: tuple[str, ...]
    sets: tuple[str, ...]


class Loop:
    """A drive under way. `hit_us`, `hit_wall_us`: when the present fault began."""

    def __init__(self, config: Config, watch: Watch, clock: ShiftedClock, supervisors: Sequence[int]) -> None:
        self.config, self.watch, self.clock = config, watch, clock
        self.supervisors = tuple(supervisors)
        self.hit_us = self.hit_wall_us = 0

    def mark(self) -> None:
        """The fault begins now."""
        self.hit_us, self.hit_wall_us = MONOTONIC.now_us(), self.clock.now_us()

    def pid_of(self, service: str) -> int:
        """The process of that name. Raises ProcessLookupError where there is none."""
        for folder in Path("/proc").glob("[0-9]*"):
            with contextlib.suppress(OSError, IndexError):
                words = (folder / "cmdline").read_text(encoding="utf-8").rstrip("\0").split("\0")
                parent = int((folder / "stat").read_text(encoding="utf-8").rpartition(") ")[2].split()[1])
                if parent in self.supervisors and words[-1] == service:
                    return int(folder.name)
        raise ProcessLookupError(service)

    @contextlib.asynccontextmanager
    async def joined(self, user: str) -> AsyncIterator[Bus]:
        """The bus as this user, beside whoever else signs in so."""
        bus = await open_bus(self.config.bus, user, self.clock)
        try:
            yield bus
        finally:
            await bus.close()

    def is_under_way(self) -> bool:
        """Everything is alive, and thrust has been applied for half a second."""
        since_us = MONOTONIC.now_us() - round(MOVING_S * 1e6)
        newest = [report.moves for report in self.watch.reports if report.at_us >= since_us]
        return all(self.watch.alive.get(name) for name in self.config.services) and sum(newest) >= MOVING_REPORTS

    async def settle(self) -> bool:
        """Under way, armed by an operator's hold where nobody has armed it; false where that does not come."""
        try:
            async with asyncio.timeout(SETTLE_S):
                while not self.is_under_way():
                    if self.is_unarmed() and all(self.watch.alive.get(name) for name in self.config.services):
                        await self.arm()
                    await asyncio.sleep(POLL_S)
        except TimeoutError:
            return False
        return True

    def is_unarmed(self) -> bool:
        """The newest report says that nobody has armed the boat."""
        return bool(self.watch.reports) and self.watch.reports[-1].cause is m.ZeroCause.NOT_ARMED

    async def arm(self) -> None:
        """Hold the button of the page once, as a person would; what is refused shows in the reports."""
        press = MONOTONIC.now_us()
        for _ in range(round(HOLD_S / REFRESH_S)):
            await asyncio.to_thread(self._press, "hold", press)
            await asyncio.sleep(REFRESH_S)
        await asyncio.to_thread(self._press, "release", press)

    def _press(self, act: str, press: int) -> None:
        page = self.config.dashboard
        connection = http.client.HTTPConnection(page.host, page.port, timeout=5.0)
        headers = {
            "Origin": f"http://{page.host}:{page.port}",
            "X-Paani-Key": ensure_operator_key(self.config.bus),
            "Content-Type": "application/json",
        }
        with contextlib.closing(connection), contextlib.suppress(OSError, http.client.HTTPException):
            connection.request("POST", f"/api/arm/{act}", msgspec.json.encode({"press": press}), headers)
            connection.getresponse().read()


async def until(condition: Callable[[], bool], limit_s: float) -> None:
    """Wait for what is heard on another thread. Raises TimeoutError."""
    async with asyncio.timeout(limit_s):
        while not condition():  # noqa: ASYNC110
            await asyncio.sleep(POLL_S)


def free_port() -> int:
    """A port of this machine that nobody has now."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@contextlib.asynccontextmanager
async def running(sides: Sequence[Side], folder: Path, environ: Mapping[str, str] | None = None) -> AsyncIterator[Loop]:
    """`paani up` once for each side, under way; heard at the last. Raises UserError with what one says that ends first.

    folder: for what they write, removed by whoever made it. environ: of their processes, beside this one's.
    """
    clock, started = ShiftedClock(), []
    try:
        for number, side in enumerate(sides):
            words = [word for setting in side.sets for word in ("--set", setting)]
            with (folder / f"{number}.out").open("wb") as output:
                command = (sys.executable, "-m", "paani", "up", *side.options, *words)
                up = await asyncio.create_subprocess_exec(
                    *command, stdin=asyncio.subprocess.DEVNULL, stdout=output, stderr=output,
                    env={**os.environ, **(environ or {})}, process_group=0,
                )  # fmt: skip
            started.append(up)
            await _await_alive(up, folder / f"{number}.out")
        config = load_config(sets=sides[-1].sets)
        bus = await open_bus(config.bus, OBSERVER, clock)
        watch = Watch(bus)
        following = asyncio.create_task(watch.follow(bus))
        try:
            yield Loop(config, watch, clock, [up.pid for up in started])
        finally:
            following.cancel()
            await bus.close()
    finally:
        for up in reversed(started):
            await _end(up)


async def _await_alive(up: asyncio.subprocess.Process, output: Path) -> None:
    deadline_us = MONOTONIC.now_us() + round(START_S * 1e6)
    while ALIVE not in (text := await asyncio.to_thread(_read, output)):
        if up.returncode is not None or MONOTONIC.now_us() > deadline_us:
            raise UserError(f"the drive did not start: {text.strip()[-500:]}")
        await asyncio.sleep(0.1)


def _read(output: Path) -> str:
    with output.open(encoding="utf-8", errors="replace") as file:
        return file.read()


async def _end(up: asyncio.subprocess.Process) -> None:
    if up.returncode is not None:
        return
    up.terminate()
    try:
        await asyncio.wait_for(up.wait(), STOP_S)
    except TimeoutError:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(up.pid, signal.SIGKILL)
        await up.wait()
