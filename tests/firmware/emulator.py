"""The microcontroller's image on an emulated Cortex-M33: its lines, its bench port, its registers.

    async with open_emulator() as mcu:
        mcu.guide, mcu.thrust      # addresses of lines: socket://127.0.0.1:PORT, or serial:/dev/pts/N with pty=True
        await mcu.set_pins("estop 1")
        pwm = await mcu.wait_for_pins(lambda pwm: not pwm.enable)

Time in the emulator is counted in instructions: a computer under load slows it, and never makes it miss a deadline.
"""

from __future__ import annotations

import asyncio
import contextlib
import fcntl
import json
import re
import shutil
import subprocess
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from tests.at_work import at_work
from tests.conftest import find_free_port
from tests.places import ROOT

BUILD = ROOT / "runs" / "mcu" / "qemu"
TOOLS = ("arm-none-eabi-g++", "qemu-system-arm", "make")
START_TIMEOUT_S = 20.0
PINS_TIMEOUT_S = 10.0
# As the processor sees them; the monitor's `xp` reads from the non-secure side, where there is nothing.
LEFT_PULSE, RIGHT_PULSE, LIGHTS = 0x50002000, 0x50002020, 0x50302000
TICKS_PER_US = 20


class Pins(NamedTuple):
    """What the two timers and the enable line hold, and when by the microcontroller's clock."""

    left_us: int
    right_us: int
    enable: bool
    mcu_ms: int


def build_image(*, paper: bool = False) -> Path:
    """Build the image; skips where the toolchain is absent. Two tests at once wait for each other."""
    absent = [tool for tool in TOOLS if shutil.which(tool) is None]
    if absent:
        pytest.skip(f"needs {', '.join(absent)}")
    BUILD.mkdir(parents=True, exist_ok=True)
    with (BUILD / ".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        subprocess.run(["make", "-s", "-C", ROOT / "mcu" / "qemu", f"OUT={BUILD}"], check=True, capture_output=True)
    return BUILD / ("paani-paper.elf" if paper else "paani.elf")


class Emulator:
    """A running image. `guide` and `thrust` are addresses of its lines; `pins` is what the bench port said last."""

    def __init__(self, process: asyncio.subprocess.Process, guide: str, thrust: str) -> None:
        self.process, self.guide, self.thrust = process, guide, thrust
        self.pins = Pins(0, 0, False, 0)
        self.history: list[Pins] = []  # every change, and a sample 50 times a second
        self.lights = ""
        self._news = asyncio.Condition()
        self._control: tuple[asyncio.StreamReader, asyncio.StreamWriter] | None = None
        self._bench: tuple[asyncio.StreamReader, asyncio.StreamWriter] | None = None

    async def set_pins(self, line: str) -> None:
        """Say a line to the bench port: `estop 1`, `rc 1600 1500 1`, `rc none`, `battery 12000 0`, `hang`."""
        assert self._bench is not None
        self._bench[1].write(f"{line}\n".encode())
        await self._bench[1].drain()

    async def wait_for_pins(self, holds: Callable[[Pins], bool], timeout_s: float = PINS_TIMEOUT_S) -> Pins:
        """The first pins from now on for which this holds."""
        begin = len(self.history)
        async with asyncio.timeout(timeout_s), self._news:
            while True:
                for pins in self.history[begin:]:
                    if holds(pins):
                        return pins
                begin = len(self.history)
                await self._news.wait()

    async def read_lights(self) -> list[str]:
        """The eight rows of the matrix, a digit for each light."""
        self.lights = ""
        await self.set_pins("matrix")
        async with asyncio.timeout(PINS_TIMEOUT_S), self._news:
            await self._news.wait_for(lambda: self.lights != "")
        return [self.lights[at : at + 13] for at in range(0, 104, 13)]

    async def read_register(self, address: int) -> int:
        """The word at an address, as QEMU's monitor reads it behind the image's back."""
        answer = await self._execute("human-monitor-command", **{"command-line": f"x /1xw {address:#x}"})
        match = re.search(r": 0x([0-9a-f]{8})", str(answer))
        assert match is not None, answer
        return int(match[1], 16)

    async def read_timers(self) -> tuple[int, int, bool]:
        """Both pulse widths in microseconds and the enable line, from the registers themselves."""
        await self.freeze()  # so that the three belong together
        left, right, lights = [await self.read_register(at) for at in (LEFT_PULSE, RIGHT_PULSE, LIGHTS)]
        await self.thaw()
        return left // TICKS_PER_US, right // TICKS_PER_US, bool(lights & 1)

    async def reset(self) -> None:
        """As by the board's reset button."""
        await self._execute("system_reset")

    async def freeze(self) -> None:
        await self._execute("stop")

    async def thaw(self) -> None:
        await self._execute("cont")

    async def _execute(self, command: str, **arguments: Any) -> Any:
        assert self._control is not None
        reader, writer = self._control
        writer.write(json.dumps({"execute": command, "arguments": arguments}).encode() + b"\n")
        async with asyncio.timeout(START_TIMEOUT_S):
            while True:
                answer = json.loads(await reader.readline())
                assert "error" not in answer, answer
                if "return" in answer:
                    return answer["return"]

    async def _open(self, control_port: int, bench_port: int) -> None:
        self._control = await _connect(control_port, self.process)
        await self._control[0].readline()  # the greeting
        await self._execute("qmp_capabilities")
        self._bench = await _connect(bench_port, self.process)

    async def _hear_bench(self) -> None:
        assert self._bench is not None
        while line := (await self._bench[0].readline()).decode(errors="replace").split():
            async with self._news:
                match line:
                    case ["pwm", left, right, enable, now_ms] if now_ms.isdecimal():
                        self.pins = Pins(int(left), int(right), enable == "1", int(now_ms))
                        self.history.append(self.pins)
                    case ["matrix", lights]:
                        self.lights = lights
                self._news.notify_all()


async def _connect(port: int, process: asyncio.subprocess.Process) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
    async with asyncio.timeout(START_TIMEOUT_S):
        while True:
            try:
                return await asyncio.open_connection("127.0.0.1", port)
            except ConnectionRefusedError:
                assert process.returncode is None, "qemu has ended"
                await asyncio.sleep(0.02)


async def _read_ptys(process: asyncio.subprocess.Process) -> list[str]:
    """QEMU names each pseudo-terminal that it has opened in a line of its own."""
    assert process.stdout is not None
    found: list[str] = []
    async with asyncio.timeout(START_TIMEOUT_S):
        while len(found) < 2:
            line = (await process.stdout.readline()).decode()
            assert line, "qemu has ended"
            found += re.findall(r"redirected to (/dev/pts/\d+)", line)
    return found


@contextlib.asynccontextmanager
async def open_emulator(*, pty: bool = False, paper: bool = False) -> AsyncIterator[Emulator]:
    """The image, booted and reporting its pins. Lines by TCP, or by pseudo-terminals; the bench port is always TCP."""
    image = await asyncio.to_thread(build_image, paper=paper)
    ports = [find_free_port() for _ in range(4)]
    tcp = [f"tcp:127.0.0.1:{port},server=on,wait=off,nodelay=on" for port in ports]
    serials = (["pty", "pty"] if pty else tcp[:2]) + [tcp[2]]
    process = await asyncio.create_subprocess_exec(
        *("qemu-system-arm", "-M", "mps2-an505", "-display", "none", "-monitor", "none"),
        *("-kernel", image, "-icount", "shift=6,sleep=on", "-qmp", tcp[3]),
        *(word for serial in serials for word in ("-serial", serial)),
        stdin=asyncio.subprocess.DEVNULL,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.DEVNULL,
    )
    emulator: Emulator | None = None
    try:
        if pty:
            guide, thrust = (f"serial:{name}" for name in await _read_ptys(process))
        else:
            guide, thrust = (f"socket://127.0.0.1:{port}" for port in ports[:2])
        emulator = Emulator(process, guide, thrust)
        await emulator._open(ports[3], ports[2])
        async with at_work(emulator._hear_bench()):
            await emulator.wait_for_pins(lambda pins: True, START_TIMEOUT_S)
            yield emulator
    finally:
        if process.returncode is None:
            process.terminate()
        await process.communicate()
        for stream in (emulator._bench, emulator._control) if emulator is not None else ():
            if stream is not None:
                stream[1].close()
