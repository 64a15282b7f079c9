"""A drive of the simulated boat whose thrust goes through the emulated microcontroller's pulses, and the direct one."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import sys
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest

from paani.config import load_config
from tests.arming import arm_on_page
from tests.conftest import find_free_port
from tests.firmware.emulator import Emulator, open_emulator
from tests.mcu_peer import served

pytestmark = [pytest.mark.firmware, pytest.mark.timeout(400)]
READY_S = 120.0
DRIVE_S = float(os.environ.get("HIL_DRIVE_S", "20"))


@contextlib.asynccontextmanager
async def bench_port(mcu: Emulator) -> AsyncIterator[str]:
    """What the bench port says from now on, for another listener: QEMU serves one."""

    async def serve(_: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        count = len(mcu.history)
        while True:
            for pins in mcu.history[count:]:
                writer.write(f"pwm {pins.left_us} {pins.right_us} {int(pins.enable)} {pins.mcu_ms}\n".encode())
                count += 1
            await writer.drain()
            await asyncio.sleep(0.005)

    async with served(serve) as port:
        yield f"socket://127.0.0.1:{port}"


@contextlib.asynccontextmanager
async def running(*words: str) -> AsyncIterator[asyncio.subprocess.Process]:
    """`paani up`, once it serves its page."""
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "paani", "up", *words), stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.STDOUT
    )
    assert process.stdout is not None
    output = ""
    try:
        async with asyncio.timeout(READY_S):
            while "http://" not in output:
                line = (await process.stdout.readline()).decode()
                assert line, output
                output += line
        yield process
    finally:
        if process.returncode is None:
            process.terminate()
            await process.communicate()


async def drive(folder: Path, *words: str) -> dict[str, Any]:
    """Figures of one `paani up`, armed on the page once everything is alive."""
    await asyncio.to_thread(folder.mkdir)
    port, summary = find_free_port(), folder / "summary.json"
    sets = (f"bus.router=tcp/127.0.0.1:{find_free_port()}", f"bus.runtime_dir={folder}", f"dashboard.port={port}")
    given = (word for setting in sets for word in ("--set", setting))
    async with running("--for", str(DRIVE_S), "--summary", str(summary), *words, *given) as process:
        await arm_on_page(f"http://127.0.0.1:{port}", load_config(sets=sets).bus)
        async with asyncio.timeout(DRIVE_S + READY_S):
            output, _ = await process.communicate()
            assert process.returncode == 0, output.decode()
    found: dict[str, Any] = json.loads(await asyncio.to_thread(summary.read_text))
    return found


def figures(summary: dict[str, Any], thruster: str) -> str:
    latency = summary["latency_ms"]["capture_to_thrust"]
    return (
        f"{summary['distance_m']:.1f} m in {summary['duration_s']:.0f} s, {summary['waypoints_reached']} waypoints, "
        f"{summary['collisions']} collisions, picture to thrust {latency['p50']:.0f} ms (p95 {latency['p95']:.0f}), "
        f"{thruster} {summary['services'][thruster]['rate_hz']:.0f} Hz"
    )


@pytest.mark.rotating(cpu_s=90)
async def test_the_simulated_boat_drives_by_the_pulses_alone(tmp_path: Path) -> None:
    """Through the firmware it makes at least three fifths of the direct adapter's way, and touches nothing."""
    direct = await drive(tmp_path / "direct", "--set", "up.arm_at_start=false")
    async with open_emulator() as mcu, bench_port(mcu) as pulses:
        lines = ("--set", f"thrusters.line={mcu.thrust}", "--set", f"plant.pwm_line={pulses}")
        looped = await drive(tmp_path / "hil", "--profile", "hil", *lines)
        moving = [pins for pins in mcu.history if pins.enable and (pins.left_us, pins.right_us) != (1500, 1500)]
        await mcu.wait_for_pins(lambda pins: not pins.enable)  # the lease ends what the processes leave
    print("\ndirect:", figures(direct, "plant"))
    print("hil:   ", figures(looped, "thrusters"))
    assert len(moving) > 50 * DRIVE_S * 0.3
    assert direct["collisions"] == looped["collisions"] == 0
    assert looped["distance_m"] > 0.6 * direct["distance_m"] > 1.0
    assert looped["services"]["thrusters"]["restarts"] == 0
