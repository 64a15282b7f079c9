"""A drive on the river with its advice on the emulated microcontroller: whatever dies before it, no arrow stays."""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from paani.config import BridgeConfig
from paani_tools.bench.faults.running import Loop, Side, running
from tests.conftest import find_free_port
from tests.firmware.emulator import Emulator, open_emulator
from tests.firmware.line_listener import STILL, LineListener, listening_on
from tests.mcu_peer import until

pytestmark = [pytest.mark.fault, pytest.mark.timeout(400)]
CHAIN = ("camera", "perception", "advisor", "router", "bridge")  # from the picture to the line
LIMIT_MS = BridgeConfig().lease_ms + 100
TRIES = 3  # until a kill had an arrow to stop
MANY = int(os.environ.get("ARROW_KILLS", "20"))  # of each process


@contextlib.asynccontextmanager
async def driving(folder: Path, line: str) -> AsyncIterator[Loop]:
    """`paani up` on the river with a bridge."""
    sets = (
        f"bus.router=tcp/127.0.0.1:{find_free_port()}",
        f"bus.runtime_dir={folder / 'runtime'}",
        f"bridge.line={line}",
    )
    async with running([Side(("--headless", "--world", "river"), sets)], folder) as loop:
        yield loop


async def kill_and_time(loop: Loop, service: str, mcu: Emulator, listener: LineListener) -> int | None:
    """Milliseconds on the microcontroller's clock from the kill of a process until the arrow was STOP.

    None where the kill had no arrow to stop: a drive that has just come back may miss a picture, so that the arrow had
    gone out before the kill was timed, or the emulated microcontroller was reset, which starts its clock anew.
    """
    pid = await asyncio.to_thread(loop.pid_of, service)
    await until(lambda: listener.display not in STILL, 60.0)
    pins = await mcu.wait_for_pins(lambda pins: True)
    os.kill(pid, signal.SIGKILL)
    before = len(listener.statuses)
    await until(lambda: any(status.display in STILL for status in listener.statuses[before:]), 10.0)
    stopped = next(status for status in listener.statuses[before:] if status.display in STILL)
    if stopped.boot_count != listener.statuses[before - 1].boot_count or stopped.mcu_ms < pins.mcu_ms:
        return None
    return stopped.mcu_ms - pins.mcu_ms


async def kill_each(folder: Path, times: int) -> dict[str, list[int]]:
    async with open_emulator() as mcu, listening_on(mcu.guide) as listener, driving(folder, listener.address) as loop:
        stopped_ms: dict[str, list[int]] = {service: [] for service in CHAIN}
        for service in CHAIN * times:
            for _ in range(TRIES):
                after_ms = await kill_and_time(loop, service, mcu, listener)
                print(f"{service}: STOP after {after_ms} ms", flush=True)
                if after_ms is not None:
                    stopped_ms[service].append(after_ms)
                    break
    return stopped_ms


async def test_whatever_dies_the_arrow_is_stop_within_its_lease(tmp_path: Path) -> None:
    stopped_ms = await kill_each(tmp_path, 1)
    assert {service: len(found) for service, found in stopped_ms.items()} == dict.fromkeys(CHAIN, 1)
    assert {service: [ms for ms in found if ms > LIMIT_MS] for service, found in stopped_ms.items()} == {
        service: [] for service in CHAIN
    }


@pytest.mark.long
@pytest.mark.timeout(7200)
async def test_whatever_dies_twenty_times_the_arrow_is_stop_within_its_lease(tmp_path: Path) -> None:
    """`ARROW_KILLS=N` sets how often."""
    stopped_ms = await kill_each(tmp_path, MANY)
    for service, found in stopped_ms.items():
        print(f"{service}: {len(found)} kills, STOP after {min(found)} to {max(found)} ms")
    assert {service: len(found) for service, found in stopped_ms.items()} == dict.fromkeys(CHAIN, MANY)
    assert max(max(found) for found in stopped_ms.values()) <= LIMIT_MS
