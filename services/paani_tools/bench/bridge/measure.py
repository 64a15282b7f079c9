"""What `paani bench bridge` measures, one function each."""

from __future__ import annotations

import asyncio
import contextlib
import random
import struct
import sys
import tempfile
from collections.abc import AsyncIterator, Callable
from pathlib import Path

import msgspec

from paani import keys
from paani import messages as m
from paani.bus import Queue, open_bus
from paani.bus.routing import open_router
from paani.clock import WallClock, stopwatch_ms
from paani.config import Config, with_settings
from paani.errors import UserError
from paani.microcontroller.caller import CallError, McuCaller
from paani.microcontroller.payloads import INDICATION, Guide, McuStatus

SPACING_S = 0.03  # between calls: none waits for another
CONNECT_TIMEOUT_S = 15.0
ANSWER_TIMEOUT_S = 5.0
MIN_REPORTS = 4  # of the bridge's health, one a second
SHF_WRITE, SHF_ALLOC, SHT_NOBITS = 1, 2, 8  # of the ELF format
Report = Callable[[float], None]  # takes the fraction that is done


class BridgeRun(msgspec.Struct, frozen=True):
    """Figures of the running process."""

    delays_ms: tuple[float, ...]
    cpu_cores: float
    rss_mib: float


@contextlib.asynccontextmanager
async def connected(address: str) -> AsyncIterator[McuCaller]:
    """A caller whose line is open and answered. Raises UserError where it is not."""
    caller = McuCaller(address, INDICATION)
    running = asyncio.create_task(caller.run())
    try:
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(CONNECT_TIMEOUT_S):
                while not caller.answered:
                    with contextlib.suppress(CallError):
                        await caller.call("paani_status")
                    await asyncio.sleep(0.05)
        if not caller.answered:
            raise UserError(caller.problem)
        yield caller
    finally:
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)


async def measure_round_trips(address: str, count: int, report: Report) -> list[float]:
    """Milliseconds from the first byte of a call to its answer; a call without one gives no sample."""
    round_trips_ms = []
    async with connected(address) as caller:
        session = random.SystemRandom().randint(1, 0xFFFF)
        for seq in range(1, count + 1):
            guide = Guide(direction=m.Direction.STRAIGHT, session=session, seq=seq, lease_ms=500)
            started_ms = stopwatch_ms()
            with contextlib.suppress(CallError):
                await caller.call("paani_guide", guide.encode())
                round_trips_ms.append(stopwatch_ms() - started_ms)
            report(seq / count)
            await asyncio.sleep(SPACING_S)
    return round_trips_ms


async def measure_lease_errors(address: str, count: int, report: Report) -> list[float]:
    """How much later than its lease said the arrow turned to STOP, by the microcontroller's clock [ms]."""
    errors_ms = list[float]()
    rng = random.Random(1)
    async with connected(address) as caller:
        changes: asyncio.Queue[McuStatus] = asyncio.Queue()
        caller.on_status = changes.put_nowait
        session = random.SystemRandom().randint(1, 0xFFFF)
        for seq in range(1, count + 1):
            lease_ms = rng.randint(50, 400)
            guide = Guide(direction=m.Direction.STRAIGHT, session=session, seq=seq, lease_ms=lease_ms)
            with contextlib.suppress(CallError, TimeoutError):
                accepted = await caller.call("paani_guide", guide.encode())
                async with asyncio.timeout(ANSWER_TIMEOUT_S):
                    while (ended := await changes.get()).state is not m.McuState.STALE or ended.seq != seq:
                        pass
                errors_ms.append(float((ended.mcu_ms - accepted.mcu_ms) % 2**32 - lease_ms))
            report(seq / count)
    return errors_ms


async def measure_bridge(line: str, config: Config, count: int, report: Report) -> BridgeRun:
    """Run the bridge on a bus of its own, and change the advice again and again."""
    with tempfile.TemporaryDirectory(prefix="paani-bench-") as folder:
        sets = (f"bridge.line={line}", f"bus.runtime_dir={folder}")
        config = with_settings(config, sets)
        router = await open_router(config.bus)
        advisor = await open_bus(config.bus, "advisor", WallClock())
        observer = await open_bus(config.bus, "observer", WallClock())
        words = [word for setting in (*sets, f"bus.router={config.bus.router}") for word in ("--set", setting)]
        process = await asyncio.create_subprocess_exec(
            sys.executable, "-m", "paani", "bridge", *words, stderr=asyncio.subprocess.DEVNULL
        )
        try:
            states = observer.queue(keys.BRIDGE_STATE, 1000)
            health = observer.queue(keys.health("bridge"), 1000)
            publisher = advisor.publisher(keys.ADVISORY)
            delays_ms = []
            await _next_state(states, lambda state: state.mcu is not m.McuState.UNKNOWN)
            for number in range(count):
                direction = (m.Direction.LEFT, m.Direction.RIGHT)[number % 2]
                started_ms = stopwatch_ms()
                publisher.put(
                    m.Advisory(source_us=WallClock().now_us(), direction=direction, reason=m.Reason.CENTER_RISK)
                )
                await _next_state(states, lambda state, wanted=direction: state.display is wanted)  # type: ignore[misc]  # of a default
                delays_ms.append(stopwatch_ms() - started_ms)
                report((number + 1) / count)
                await asyncio.sleep(random.uniform(0.15, 0.35))  # at any phase of the frames
            reports = health.drain()
            async with asyncio.timeout(CONNECT_TIMEOUT_S):
                while len(reports) < MIN_REPORTS:
                    reports.append(await health.get())
        finally:
            if process.returncode is None:
                process.terminate()
            await process.wait()
            await advisor.close()
            await observer.close()
            await asyncio.to_thread(router.close)
    del reports[0]  # of the start
    return BridgeRun(
        tuple(delays_ms),
        sum(each.cpu_cores for each in reports) / len(reports),
        max(each.rss_mib for each in reports),
    )


async def _next_state(states: Queue[m.BridgeState], condition: Callable[[m.BridgeState], bool]) -> None:
    """Wait for a state. Raises UserError with the line's problem when none comes."""
    newest: m.BridgeState | None = None
    try:
        async with asyncio.timeout(CONNECT_TIMEOUT_S):
            while newest is None or not condition(newest):
                newest = await states.get()
    except TimeoutError as error:
        raise UserError(newest.problem if newest and newest.problem else "the bridge does not answer") from error


def measure_image(image: Path) -> tuple[int, int, int]:
    """Bytes of code and constants, of initialised data and of zeroed data, from the sections of the ELF file."""
    data = image.read_bytes()
    if data[:6] != b"\x7fELF\x01\x01":
        raise UserError(f"--image {image}: is no 32-bit ELF file")
    sections_at, _, _, _, _, entry_bytes, sections = struct.unpack_from("<IIHHHHH", data, 0x20)
    text = initialised = zeroed = 0
    for number in range(sections):
        _, kind, flags, _, _, size = struct.unpack_from("<IIIIII", data, sections_at + number * entry_bytes)
        if flags & SHF_ALLOC:
            if kind == SHT_NOBITS:
                zeroed += size
            elif flags & SHF_WRITE:
                initialised += size
            else:
                text += size
    return text, initialised, zeroed
