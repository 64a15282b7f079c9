"""Faults of processes: killed, frozen, without memory, descriptors or disk, and beside a greedy neighbour."""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import os
import resource
import signal
import sys
from collections.abc import AsyncIterator, Callable, Sequence
from pathlib import Path

import msgspec

from paani.bus.hearing import DEAF_S
from paani_tools.bench.faults.fault import Expected, Fault
from paani_tools.bench.faults.running import MONOTONIC, Loop, until

GONE_S, BACK_S = 10.0, 40.0
FROZEN_S, REFUSED_S, REFUSED_MEMORY_S = 1.0, 2.0, 5.0
SPEAKS_S = DEAF_S + 1.0  # whoever reports its health so long after it lacked anything hears, too
NEEDS_A_HAND = frozenset({"operator", "dashboard"})  # who armed, and where: nobody knows whether they still want it
RECORDER = "recorder"
NOBODY_WAITS_FOR = frozenset({RECORDER, "bridge"})
ADAPTER = "plant"
SILENT_CONNECTIONS = 150
NEIGHBOURS = 4


def process_faults(services: tuple[str, ...]) -> list[Fault]:
    """One of each kind for every process that can have it."""
    boat = [name for name in services if name != RECORDER]
    return [
        *(_killed(name) for name in services),
        *(_frozen(name) for name in services),
        *(_refused_memory(name) for name in services),
        _limited("disk full", boat, resource.RLIMIT_FSIZE),  # no file grows
        _limited("no descriptors left", boat, resource.RLIMIT_NOFILE, _first_free),  # no file, no connection opens
        _silent_connections(),
        _greedy_neighbour(),
    ]


def _expected(service: str) -> Expected:
    return Expected.GOES_ON if service in NOBODY_WAITS_FOR else Expected.STOPS


def _killed(service: str) -> Fault:
    async def begin(loop: Loop) -> None:
        loop.kill(service)

    async def end(loop: Loop) -> None:
        await back_again(loop, service)

    expected = Expected.HAND if service in NEEDS_A_HAND else _expected(service)
    name, away = f"{service} killed", service == ADAPTER
    return Fault(name=name, expected=expected, begin=begin, end=end, hurts_adapter=away)


def _first_free(pid: int) -> int:
    """The lowest descriptor that a process has not open, and would be given next."""
    taken = {int(entry.name) for entry in Path(f"/proc/{pid}/fd").iterdir()}
    return next(number for number in itertools.count() if number not in taken)


async def back_again(loop: Loop, service: str) -> None:
    """Wait until a process that was killed as the fault began has ended, and is alive again. Raises TimeoutError."""
    watch = loop.watch
    await until(lambda: watch.changed_us.get(service, 0) > loop.hit_us, GONE_S)
    await until(lambda: watch.alive.get(service, False), BACK_S)


def _frozen(service: str) -> Fault:
    frozen: list[int] = []

    async def begin(loop: Loop) -> None:
        frozen.append(loop.pid_of(service))
        loop.mark()
        os.kill(frozen[-1], signal.SIGSTOP)

    async def end(loop: Loop) -> None:
        os.kill(frozen[-1], signal.SIGCONT)

    return Fault(
        name=f"{service} not running", expected=_expected(service), begin=begin, end=end, lasts_s=FROZEN_S,
        hurts_adapter=service == ADAPTER,
    )  # fmt: skip


def _limited(
    name: str,
    services: Sequence[str],
    limit: int,
    most: Callable[[int], int] = lambda pid: 0,
    expected: Expected = Expected.GOES_ON,
    lasts_s: float = REFUSED_S,
) -> Fault:
    """The kernel gives these processes no more of something than `most` says of each; what they ask for fails."""
    before: dict[int, tuple[int, int]] = {}

    async def begin(loop: Loop) -> None:
        before.clear()
        before.update({pid: resource.prlimit(pid, limit) for pid in map(loop.pid_of, services)})
        loop.mark()
        for pid, (_, hard) in before.items():
            resource.prlimit(pid, limit, (most(pid), hard))

    async def end(loop: Loop) -> None:
        for pid, limits in before.items():
            with contextlib.suppress(ProcessLookupError):
                resource.prlimit(pid, limit, limits)

    return Fault(
        name=name, expected=expected, begin=begin, end=end, lasts_s=lasts_s, hurts_adapter=services == [ADAPTER]
    )


def _refused_memory(service: str) -> Fault:
    """Of one process, followed until it works, or has been ended and another works in its place."""
    expected = Expected.MAY_STAND if service in NEEDS_A_HAND else Expected.GOES_ON
    name = f"{service} refused memory"
    limited = _limited(name, [service], resource.RLIMIT_AS, _address_space, expected, REFUSED_MEMORY_S)

    async def end(loop: Loop) -> None:
        await limited.end(loop)
        settled_us = MONOTONIC.now_us() + round(SPEAKS_S * 1e6)
        await until(lambda: loop.watch.healthy_us.get(service, 0) > settled_us, BACK_S)

    return msgspec.structs.replace(limited, end=end)


def _address_space(pid: int) -> int:
    """What a process has now [bytes]."""
    pages = Path(f"/proc/{pid}/statm").read_text(encoding="ascii").split()[0]
    return int(pages) * resource.getpagesize()


def _silent_connections() -> Fault:
    """Connections that say nothing, to the page and to the router, until neither takes one more."""
    connected = contextlib.AsyncExitStack()

    async def begin(loop: Loop) -> None:
        loop.mark()
        router = loop.config.bus.router.rpartition(":")[2]
        for port in (loop.config.dashboard.port, int(router)):
            for _ in range(SILENT_CONNECTIONS):
                with contextlib.suppress(OSError, TimeoutError):
                    await connected.enter_async_context(_connection(port))

    async def end(loop: Loop) -> None:
        await connected.aclose()

    name = f"{2 * SILENT_CONNECTIONS} silent connections"
    return Fault(name=name, expected=Expected.GOES_ON, begin=begin, end=end, lasts_s=REFUSED_S)


@contextlib.asynccontextmanager
async def _connection(port: int) -> AsyncIterator[None]:
    _, writer = await asyncio.wait_for(asyncio.open_connection("127.0.0.1", port), 1.0)
    try:
        yield
    finally:
        writer.close()


def _greedy_neighbour() -> Fault:
    """Programs beside the boat's that want all the processor there is."""
    neighbours: list[asyncio.subprocess.Process] = []

    async def begin(loop: Loop) -> None:
        loop.mark()
        for _ in range(NEIGHBOURS):
            neighbours.append(await asyncio.create_subprocess_exec(sys.executable, "-c", "while True: pass"))

    async def end(loop: Loop) -> None:
        while neighbours:
            neighbour = neighbours.pop()
            neighbour.kill()
            await neighbour.wait()

    name = f"{NEIGHBOURS} busy neighbours"
    return Fault(name=name, expected=Expected.GOES_ON, begin=begin, end=end, lasts_s=REFUSED_S)
