"""A drive of one's own to hurt: `paani up` with a bus, a runtime folder and settings that nobody else has."""

from __future__ import annotations

import asyncio
import contextlib
import http.client
import os
import signal
import socket
import sys
from collections.abc import AsyncIterator, Callable, Iterable, Mapping, Sequence
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
from paani.operator_client import OperatorClient
from paani.operator_key import ensure_operator_key

MONOTONIC = MonotonicClock()
HOLD_S, REFRESH_S = 1.3, 0.15
START_S, STOP_S, SETTLE_S = 90.0, 10.0, 40.0
STOP_CONFIRMED_S = 2.0
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
    """What the thrust adapter reported: heard at [us, monotonic]; by its own clock, when, and since when it is zero."""

    at_us: int
    moves: bool
    cause: m.ZeroCause
    source_us: int
    zero_since_us: int


class Watch:
    """What is heard of the drive by somebody who only looks.

    `healthy_us`: when each of the services last reported its health [us, monotonic].
    """

    def __init__(self, bus: Bus, services: Iterable[str]) -> None:
        self.reports: list[Report] = []
        self.decided_us: list[int] = []
        self.sim_s = 0.0
        self.alive: dict[str, bool] = {}
        self.changed_us: dict[str, int] = {}
        self.healthy_us: dict[str, int] = {}
        for service in services:
            bus.on(keys.health(service), self._hear_health)
        bus.on(keys.THRUST_APPLIED, self._hear_applied)
        bus.on(keys.EVIDENCE, self._hear_evidence)
        bus.on(keys.TRUE_POSE, self._hear_pose)

    def _hear_applied(self, applied: m.ThrustApplied) -> None:
        moves = applied.left_n != 0.0 or applied.right_n != 0.0
        heard = (MONOTONIC.now_us(), moves, applied.zero_cause, applied.source_us, applied.zero_since_us)
        self.reports.append(Report(*heard))

    def _hear_health(self, health: m.Health) -> None:
        self.healthy_us[health.producer] = MONOTONIC.now_us()

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


class Up:
    """One `paani up`, and the file that holds what it says. environ: of its processes, beside this one's."""

    def __init__(self, side: Side, output: Path, environ: Mapping[str, str]) -> None:
        self._side, self._output, self._environ = side, output, environ
        self._process: asyncio.subprocess.Process | None = None

    @property
    def pid(self) -> int:
        """Of the supervisor; 0 before its first start."""
        return 0 if self._process is None else self._process.pid

    @property
    def has_ended(self) -> bool:
        """By itself, as it does for a user's mistake."""
        return self._process is not None and self._process.returncode is not None

    async def start(self) -> None:
        """Returns when everything is alive. Raises UserError with what it says where it ends first."""
        words = [word for setting in self._side.sets for word in ("--set", setting)]
        with self._output.open("wb") as output:
            command = (sys.executable, "-m", "paani", "up", *self._side.options, *words)
            self._process = await asyncio.create_subprocess_exec(
                *command, stdin=asyncio.subprocess.DEVNULL, stdout=output, stderr=output,
                env={**os.environ, **self._environ}, process_group=0,
            )  # fmt: skip
        deadline_us = MONOTONIC.now_us() + round(START_S * 1e6)
        while ALIVE not in (text := await asyncio.to_thread(self._text)):
            if self.has_ended or MONOTONIC.now_us() > deadline_us:
                raise UserError(f"the drive did not start: {text.strip()[-500:]}")
            await asyncio.sleep(0.1)

    async def stop(self) -> None:
        """End it and its processes."""
        if self._process is None or self.has_ended:
            return
        self._process.terminate()
        try:
            await asyncio.wait_for(self._process.wait(), STOP_S)
        except TimeoutError:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self._process.pid, signal.SIGKILL)
            await self._process.wait()

    def _text(self) -> str:
        with self._output.open(encoding="utf-8", errors="replace") as file:
            return file.read()


class Loop:
    """A drive under way. `hit_us`, `hit_wall_us`: when the present fault began."""

    def __init__(self, config: Config, watch: Watch, clock: ShiftedClock, ups: Sequence[Up]) -> None:
        self.config, self.watch, self.clock, self._ups = config, watch, clock, ups
        self.hit_us = self.hit_wall_us = 0

    async def wait_for_end(self, limit_s: float) -> None:
        """Until a `paani up` has ended by itself. Raises TimeoutError."""
        await until(lambda: any(up.has_ended for up in self._ups), limit_s)

    async def start_again(self) -> None:
        """Whatever `paani up` has ended by itself, until everything is alive. Raises ChildProcessError."""
        for up in self._ups:
            if up.has_ended:
                await up.start()

    def mark(self) -> None:
        """The fault begins now."""
        self.hit_us, self.hit_wall_us = MONOTONIC.now_us(), self.clock.now_us()

    def kill(self, service: str) -> None:
        """The fault begins with the death of this process. Raises ProcessLookupError where there is none."""
        pid = self.pid_of(service)
        self.mark()
        os.kill(pid, signal.SIGKILL)

    def pid_of(self, service: str) -> int:
        """The process of that name. Raises ProcessLookupError where there is none."""
        for folder in Path("/proc").glob("[0-9]*"):
            with contextlib.suppress(OSError, IndexError):
                words = (folder / "cmdline").read_text(encoding="utf-8").rstrip("\0").split("\0")
                parent = int((folder / "stat").read_text(encoding="utf-8").rpartition(") ")[2].split()[1])
                if parent in {up.pid for up in self._ups} and words[-1] == service:
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
        """The newest report says that nobody has armed the boat, or its microcontroller."""
        return bool(self.watch.reports) and self.watch.reports[-1].cause in {m.ZeroCause.NOT_ARMED, m.ZeroCause.REARM}

    async def arm(self) -> None:
        """Hold the button of the page once, as a person would; what is refused shows in the reports.

        A microcontroller that has disarmed by itself wants to see the boat disarmed first: that is STOP.
        """
        if self.watch.reports[-1].cause is m.ZeroCause.REARM:
            async with self.joined("stop") as bus:
                await OperatorClient(bus, self.clock).stop(STOP_CONFIRMED_S)
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
    clock, ups = (
        ShiftedClock(),
        [Up(side, folder / f"{number}.out", environ or {}) for number, side in enumerate(sides)],
    )
    try:
        for up in ups:
            await up.start()
        config = load_config(sets=sides[-1].sets)
        bus = await open_bus(config.bus, OBSERVER, clock)
        watch = Watch(bus, keys.services_in(config.bus.graph))
        following = asyncio.create_task(watch.follow(bus))
        try:
            yield Loop(config, watch, clock, ups)
        finally:
            following.cancel()
            await bus.close()
    finally:
        for up in reversed(ups):
            await up.stop()
