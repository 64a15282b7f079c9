"""The drives that are hurt, each with its faults, and why one cannot be had here."""

from __future__ import annotations

import asyncio
import contextlib
import shutil
import tempfile
from collections.abc import AsyncIterator
from pathlib import Path

from paani.config import load_config
from paani.errors import UserError
from paani.extras import require_modules
from paani_tools.bench.bridge.emulator import IMAGE, emulated, require_emulator
from paani_tools.bench.faults.cable import Cable, serial_faults
from paani_tools.bench.faults.expiry import Certificates, certificate_faults
from paani_tools.bench.faults.fault import Drive, Fault
from paani_tools.bench.faults.inputs import clock_faults, peer_faults, scenario_faults, scenario_text
from paani_tools.bench.faults.link import Relay, link_faults
from paani_tools.bench.faults.processes import process_faults
from paani_tools.bench.faults.running import Loop, Side, free_port, running
from paani_tools.bench.faults.versions import other_version

LIBRARIES = ("/usr/lib/*/faketime/libfaketimeMT.so.1", "/usr/local/lib/faketime/libfaketimeMT.so.1")
HOST = "tcp/127.0.0.1"


def faults_of(drive: Drive) -> list[Fault]:
    """In the order they are made."""
    match drive:
        case Drive.PLAIN:
            services = (*load_config().services, "recorder")
            return [*scenario_faults(), *process_faults(services), *peer_faults(), other_version()]
        case Drive.CLOCK:
            return clock_faults(Path())
        case Drive.LINK:
            return link_faults(Relay(0, 0))
        case Drive.CERTIFICATES:
            return certificate_faults(Certificates(Path()))
        case Drive.SERIAL:
            return serial_faults(None, None)


def missing(drive: Drive) -> str:
    """What this machine lacks for this drive; empty where nothing."""
    try:
        match drive:
            case Drive.CLOCK if not faked_clock():
                return "needs libfaketime (Debian: faketime)"
            case Drive.CERTIFICATES:
                require_modules("it", "cryptography")
            case Drive.SERIAL:
                require_emulator(IMAGE)
    except UserError as error:
        return str(error)
    return ""


@contextlib.asynccontextmanager
async def driving(drive: Drive) -> AsyncIterator[tuple[Loop, dict[str, Fault]]]:
    """This drive under way, and its faults by name, bound to it. Raises UserError where it does not start."""
    folder = Path(await asyncio.to_thread(tempfile.mkdtemp, prefix="paani-faults-"))
    try:
        async with _start(drive, folder) as (loop, faults):
            yield loop, {fault.name: fault for fault in faults}
    finally:
        await asyncio.to_thread(shutil.rmtree, folder, ignore_errors=True)


@contextlib.asynccontextmanager
async def _start(drive: Drive, folder: Path) -> AsyncIterator[tuple[Loop, list[Fault]]]:
    match drive:
        case Drive.PLAIN:
            scenario = folder / "scenario.toml"
            await asyncio.to_thread(scenario.write_text, scenario_text(), encoding="utf-8")
            options = ("--world", str(scenario), "--record", str(folder / "recording"))
            async with running([Side(options, _own(folder))], folder) as loop:
                yield loop, faults_of(drive)
        case Drive.CLOCK:
            file = folder / "clock"
            await asyncio.to_thread(file.write_text, "+0\n", encoding="ascii")
            environ = faked_clock() | {"FAKETIME_TIMESTAMP_FILE": str(file)}
            async with running([Side((), _own(folder))], folder, environ) as loop:
                yield loop, clock_faults(file)
        case Drive.LINK:
            board, host = free_port(), free_port()
            relay = Relay(host, board)
            await relay.start()
            sides = [
                Side(("--only", name), (*_own(folder), f"bus.link={HOST}:{port}", f"bus.side={name}"))
                for name, port in (("board", board), ("host", host))
            ]
            try:
                async with running(sides, folder) as loop:
                    yield loop, link_faults(relay)
            finally:
                await relay.stop()
        case Drive.CERTIFICATES:
            certificates = Certificates(folder)
            await asyncio.to_thread(certificates.make)
            sets = (*_own(folder), f"bus.certificates={certificates.live}", "up.arm_at_start=false")  # it starts again
            async with running([Side((), sets)], folder) as loop:
                yield loop, certificate_faults(certificates)
        case Drive.SERIAL:
            async with emulated(IMAGE, "pty") as (advice_line, thrust_line, pulses_line):
                with contextlib.closing(Cable(advice_line)) as advice, contextlib.closing(Cable(thrust_line)) as thrust:
                    lines = (f"bridge.line={advice.address}", f"thrusters.line={thrust.address}")
                    sets = ("profile=hil", *_own(folder), *lines, f"plant.pwm_line={pulses_line}")
                    async with running([Side((), sets)], folder) as loop:
                        yield loop, serial_faults(thrust, advice)


def _own(folder: Path) -> tuple[str, ...]:
    """Settings that nobody else's drive has."""
    return (
        f"bus.router={HOST}:{free_port()}",
        f"bus.runtime_dir={folder / 'runtime'}",
        f"dashboard.port={free_port()}",
    )


def faked_clock() -> dict[str, str]:
    """Environment of processes whose wall clock a further variable of libfaketime shifts; empty without libfaketime."""
    found = [str(path) for pattern in LIBRARIES for path in Path("/").glob(pattern.lstrip("/"))]
    return {"LD_PRELOAD": found[0], "FAKETIME_CACHE_DURATION": "1", "DONT_FAKE_MONOTONIC": "1"} if found else {}
