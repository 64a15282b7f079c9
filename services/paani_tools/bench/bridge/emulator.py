"""The firmware on an emulated Cortex-M33: QEMU's `mps2-an505`, whose serial lines are sockets or pseudo-terminals."""

from __future__ import annotations

import asyncio
import contextlib
import re
import shutil
import socket
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Literal

import paani_tools
from paani.errors import UserError

Transport = Literal["tcp", "pty"]
QEMU = "qemu-system-arm"
IMAGE = Path(paani_tools.__path__[0]).parents[1] / "runs/mcu/qemu/paani.elf"  # where `make -C mcu/qemu` puts it
LINES = 3  # indication, thrust, and the bench port of the tests
START_TIMEOUT_S = 20.0


def require_emulator(image: Path) -> str:
    """Path of QEMU. Raises UserError that says what to install or to build."""
    found = shutil.which(QEMU)
    if found is None:
        raise UserError(f"{QEMU}: not installed (Debian and Ubuntu: apt install qemu-system-arm)")
    if not image.is_file():
        raise UserError(f"--image {image}: no such file (make -C mcu/qemu builds it; it needs gcc-arm-none-eabi)")
    return found


@contextlib.asynccontextmanager
async def emulated(image: Path, transport: Transport) -> AsyncIterator[tuple[str, str, str]]:
    """The addresses of the three lines while the microcontroller runs. Raises UserError where it does not start."""
    # Time counted in instructions: a busy machine slows the emulated clock, which then misses no deadline of its own.
    command = [require_emulator(image), "-M", "mps2-an505", "-display", "none", "-monitor", "none"]
    command += ["-kernel", str(image), "-icount", "shift=6,sleep=on"]
    ports = [_free_port() for _ in range(LINES)]
    for port in ports:
        command += ["-serial", "pty" if transport == "pty" else f"tcp:127.0.0.1:{port},server=on,wait=off"]
    process = await asyncio.create_subprocess_exec(
        *command, stdin=asyncio.subprocess.DEVNULL, stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.STDOUT
    )
    try:
        if transport == "pty":
            first, second, third = [f"serial:{path}@115200" for path in await _terminals(process)]
        else:
            await _until_listening(process, ports[0])
            first, second, third = [f"socket://127.0.0.1:{port}" for port in ports]
        yield first, second, third
    finally:
        if process.returncode is None:
            process.kill()
        await process.communicate()


async def _terminals(process: asyncio.subprocess.Process) -> list[str]:
    """The pseudo-terminals that QEMU names when it starts."""
    assert process.stdout is not None
    text = ""
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(START_TIMEOUT_S):
            while len(paths := re.findall(r"redirected to (/dev/pts/\d+)", text)) < LINES:
                line = await process.stdout.readline()
                if not line:
                    break
                text += line.decode(errors="replace")
    if len(paths) < LINES:
        raise UserError(f"{QEMU}: {text.strip() or 'named no pseudo-terminals'}")
    return paths


async def _until_listening(process: asyncio.subprocess.Process, port: int) -> None:
    """QEMU listens before the firmware runs; the connection is tried where it is used."""
    for _ in range(round(START_TIMEOUT_S / 0.05)):
        if process.returncode is not None:
            assert process.stdout is not None
            raise UserError(f"{QEMU}: {(await process.stdout.read()).decode(errors='replace').strip()}")
        if await asyncio.to_thread(_is_bound, port):
            return
        await asyncio.sleep(0.05)
    raise UserError(f"{QEMU}: does not listen on port {port}")


def _is_bound(port: int) -> bool:
    """Whether somebody listens; asked without connecting, since QEMU's lines take one connection each."""
    with socket.socket() as probe:
        try:
            probe.bind(("127.0.0.1", port))
        except OSError:
            return True
    return False


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
