"""`paani calibrate thrusters` at a terminal: an operator holds a key and lets go; thrusters of known kind turn."""

from __future__ import annotations

import asyncio
import contextlib
import os
import pty
import sys
import tomllib
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from paani.clock import stopwatch_ms
from paani_tools.calibrate.thrusters.ramp import RELEASED_S
from tests.mcu_peer import PtyLine, until
from tests.thrust_peer import ESTOP, ThrustPeer

pytestmark = pytest.mark.integration
REPEAT_S = 0.04  # of a held key


class Motor(NamedTuple):
    """A thruster with its controller: the pulse at rest, where it begins to turn, and which way."""

    rest_us: int
    deadband_us: int
    is_reversed: bool

    def turns(self, pulse_us: int) -> bool:
        return abs(pulse_us - self.rest_us) > self.deadband_us


MOTORS = {"left": Motor(1512, 30, False), "right": Motor(1494, 22, True)}


class Operator:
    """A terminal with somebody at it, and the microcontroller whose thrusters he sees."""

    def __init__(self, peer: Any, process: asyncio.subprocess.Process, terminal: int) -> None:
        self.peer, self.process, self._terminal = peer, process, terminal
        self.seen = ""
        os.set_blocking(terminal, False)
        asyncio.get_running_loop().add_reader(terminal, self._read)

    def _read(self) -> None:
        try:
            self.seen += os.read(self._terminal, 4096).decode()
        except OSError:
            asyncio.get_running_loop().remove_reader(self._terminal)

    def type(self, text: str) -> None:
        os.write(self._terminal, text.encode())

    async def reads(self, text: str) -> None:
        await until(lambda: text in self.seen, 15.0)
        self.seen = self.seen.partition(text)[2]

    def pulse_us(self, side: str) -> int:
        return self.peer.pulses_us()[side == "right"] if self.peer.is_live() else 1500

    async def calibrate(self) -> None:
        """All steps, as they are asked for."""
        await self.reads("press ENTER when the boat is tied up")
        self.type("\n")
        for side, motor in MOTORS.items():
            for number, pulses in enumerate(("longer", "shorter")):
                await self.reads(f"{side}, {pulses} pulses")
                await self.hold_until_it_turns(side)
                await until(lambda: not self.peer.is_live())
                self.type("\n")
                if number == 0:
                    await self.reads("which way")
                    self.type("s" if motor.is_reversed else "a")
        await self.reads("written to")
        assert await self.process.wait() == 0

    async def hold_until_it_turns(self, side: str) -> None:
        async with asyncio.timeout(20.0):
            while not (self.peer.is_live() and MOTORS[side].turns(self.pulse_us(side))):
                self.type(" ")
                await asyncio.sleep(REPEAT_S)
                other = "left" if side == "right" else "right"
                assert self.pulse_us(other) == 1500, "one thruster at a time"


@contextlib.asynccontextmanager
async def at_a_terminal(tmp_path: Path, *arguments: str) -> AsyncIterator[Operator]:
    """The command at a terminal, and a microcontroller at its line."""
    peer = ThrustPeer()
    line = PtyLine(str(tmp_path / "ttyTHRUST"), peer)
    line.plug_in()
    try:
        async with calibrating(tmp_path, peer, line.address, *arguments) as operator:
            yield operator
    finally:
        line.pull_out()


@contextlib.asynccontextmanager
async def calibrating(tmp_path: Path, peer: Any, address: str, *arguments: str) -> AsyncIterator[Operator]:
    """The command at a terminal, with whatever is at its line."""
    terminal, inner = pty.openpty()
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "paani", "calibrate", "thrusters", "--set", f"thrusters.line={address}",
        "--out", str(tmp_path / "thrusters.toml"), *arguments,
        stdin=inner, stdout=inner, stderr=inner, start_new_session=True,
    )  # fmt: skip
    os.close(inner)
    try:
        yield Operator(peer, process, terminal)
    finally:
        if process.returncode is None:
            process.kill()
        await process.wait()
        asyncio.get_running_loop().remove_reader(terminal)
        os.close(terminal)


async def test_both_sides_are_found_and_written(tmp_path: Path) -> None:
    async with at_a_terminal(tmp_path) as operator:
        await operator.calibrate()
    require_found(tmp_path)


def require_found(tmp_path: Path) -> None:
    """What was written is what the motors are."""
    written = tomllib.loads((tmp_path / "thrusters.toml").read_text())["thrusters"]
    for side, motor in MOTORS.items():
        assert written[side]["reversed"] is motor.is_reversed
        assert written[side]["trim_us"] == pytest.approx(motor.rest_us - 1500, abs=8)
        assert written[side]["deadband_us"] == pytest.approx(motor.deadband_us, abs=12)


async def test_motion_lasts_as_long_as_the_key(tmp_path: Path) -> None:
    async with at_a_terminal(tmp_path) as operator:
        await operator.reads("tied up")
        assert not operator.peer.is_live()
        operator.type("\n")
        await operator.reads("longer pulses")
        operator.type(" ")
        await asyncio.sleep(0.5)
        assert not operator.peer.is_live(), "a single press drives nothing"
        await operator.hold_until_it_turns("left")
        released_ms = stopwatch_ms()
        await until(lambda: not operator.peer.is_live())
        assert stopwatch_ms() - released_ms < RELEASED_S * 1e3 + 400.0
        assert not operator.peer.newest.armed
        operator.peer.hold(ESTOP)
        for _ in range(20):
            operator.type(" ")
            await asyncio.sleep(REPEAT_S)
        assert not operator.peer.is_live()
        await operator.reads("held by emergency stop")


async def test_whoever_gives_up_leaves_no_file(tmp_path: Path) -> None:
    async with at_a_terminal(tmp_path) as operator:
        await operator.reads("tied up")
        operator.type("\n")
        await operator.reads("longer pulses")
        await operator.hold_until_it_turns("left")
        operator.type("q")
        await operator.reads("given up; nothing is written")
        assert await operator.process.wait() == 1
        assert not operator.peer.newest.armed
    assert not await asyncio.to_thread(lambda: list(tmp_path.iterdir()))


async def test_a_killed_calibration_stops_with_its_lease(tmp_path: Path) -> None:
    async with at_a_terminal(tmp_path) as operator:
        await operator.reads("tied up")
        operator.type("\n")
        await operator.reads("longer pulses")
        await operator.hold_until_it_turns("left")
        operator.process.kill()
        await operator.process.wait()
        await until(lambda: not operator.peer.is_live(), operator.peer.lease_ms * 1e-3 + 0.1)
        assert operator.peer.lease_ms == 200


async def test_without_a_terminal_or_a_line_nothing_begins(tmp_path: Path) -> None:
    out = ("--out", str(tmp_path / "x.toml"))
    for arguments, named in (
        (out, "thrusters.line: not set"),
        ((*out, "--set", "thrusters.line=serial:/dev/absent"), "needs a terminal"),
        ((), "--out"),
    ):
        process = await asyncio.create_subprocess_exec(
            sys.executable, "-m", "paani", "calibrate", "thrusters", *arguments,
            stdin=asyncio.subprocess.DEVNULL, stdout=asyncio.subprocess.DEVNULL, stderr=asyncio.subprocess.PIPE,
        )  # fmt: skip
        _, errors = await process.communicate()
        assert process.returncode == 2
        assert named in errors.decode()
    assert not (tmp_path / "x.toml").exists()


async def test_a_device_that_is_not_there_is_named(tmp_path: Path) -> None:
    async with at_a_terminal(tmp_path, "--set", "thrusters.line=serial:/dev/absent") as operator:
        await operator.reads("thrusters.line serial:/dev/absent: No such file or directory")
        assert await operator.process.wait() == 2
