"""`paani calibrate thrusters`: walks the operator through both sides, and writes what was found."""

from __future__ import annotations

import argparse
import asyncio
import sys
from typing import NamedTuple

from paani.cli import add_config_arguments, config_from
from paani.clock import stopwatch_ms
from paani.config import EscConfig, ThrustersConfig
from paani.errors import UserError
from paani.microcontroller.payloads import McuStatus
from paani.option_paths import output_file, require_apart
from paani.whole_file import write_whole
from paani_tools.calibrate.thrusters.bench import FRAME_S, Bench, connected, holds_text, is_driven
from paani_tools.calibrate.thrusters.ramp import DeadMan, Ramp, fit_esc, settings_toml
from paani_tools.calibrate.thrusters.terminal import raw_keys

INTRODUCTION = """The thrusters will turn. Tie the boat up, bow and stern. Keep hands, hair and lines away, and
the emergency stop within reach. `paani up` must not run.

A thruster turns only while the space bar is held, one at a time, slowly faster. Let go at the moment it begins to turn.
ENTER keeps what was found, R begins this step again, Q gives up; then nothing is written.
"""
SIDES = ("left", "right")


class GaveUp(Exception):
    """The operator gave up."""


class _Begin(NamedTuple):
    """How far from the neutral pulse a side began to turn."""

    longer_us: float
    shorter_us: float


def main(argv: list[str]) -> int:
    """Exit codes: 0 written, 1 given up, 2 the user's mistake. Only a finished calibration writes the file."""
    options = _parser().parse_args(argv)
    settings = config_from(options).thrusters
    require_apart({"--out": options.out}, (options.config,))
    if not settings.line:
        raise UserError("thrusters.line: not set (--set thrusters.line=serial:/dev/ttyACM1@115200)")
    sys.stdout.write(INTRODUCTION)
    try:
        left, right = asyncio.run(_calibrate(settings))
    except GaveUp:
        sys.stdout.write("\ngiven up; nothing is written\n")
        return 1
    text = settings_toml(settings.line, settings.neutral_us, settings.span_us, left, right)
    write_whole(options.out, text.encode(), "--out")
    sys.stdout.write(f"\n{text}\nwritten to {options.out}: paani up --profile hull --config {options.out}\n")
    return 0


async def _calibrate(settings: ThrustersConfig) -> tuple[EscConfig, EscConfig]:
    with raw_keys() as keys:
        async with connected(settings) as bench:
            walk = _Walk(bench, keys)
            await walk.ask("press ENTER when the boat is tied up", "\n")
            found = [await walk.calibrate(side) for side in SIDES]
    return found[0], found[1]


class _Walk:
    """The operator's way through the steps. Frames go on all the time, disarmed unless the key is held."""

    def __init__(self, bench: Bench, keys: asyncio.Queue[str]) -> None:
        self._bench, self._keys = bench, keys
        self._shown = ""

    async def calibrate(self, side: str) -> EscConfig:
        """Both directions of one side."""
        longer_us = await self._find_begin(side, 1)
        answer = await self.ask(f"{side}: which way did it push the boat? A ahead, S astern", "as")
        begin = _Begin(longer_us, await self._find_begin(side, -1))
        return fit_esc(side, begin.longer_us, begin.shorter_us, is_reversed=answer == "s")

    async def ask(self, question: str, answers: str) -> str:
        """The first key that is an answer, once a disarmed frame was taken: only after one does anything arm."""
        self._say(f"\n{question}\n")
        answer, is_disarmed = "", False
        while not (answer and is_disarmed):
            is_disarmed |= await self._bench.send(0.0, 0.0, is_armed=False) is not None
            answer = answer or next((key for key in self._pressed() if key in answers), "")
            await asyncio.sleep(FRAME_S)
        return answer

    async def _find_begin(self, side: str, sign: int) -> float:
        """How far from neutral [us] the side begins to turn, with longer (1) or shorter (-1) pulses."""
        self._say(f"\n{side}, {'longer' if sign > 0 else 'shorter'} pulses: hold SPACE until it begins to turn\n")
        ramp, dead_man, last_ms = Ramp(self._bench.span_us), DeadMan(), stopwatch_ms()
        while True:
            now_ms = stopwatch_ms()
            for key in self._pressed():
                if key == " ":
                    dead_man.press(now_ms * 1e-3)
                    ramp.mark()
                elif key == "r":
                    ramp.restart()
                elif key in "\r\n" and ramp.offset_us > 0.0 and not dead_man.is_held(now_ms * 1e-3):
                    return ramp.offset_us
            is_held = dead_man.is_held(now_ms * 1e-3)
            if not is_held:
                ramp.release()
            await self._drive(side, sign, ramp, (now_ms - last_ms) * 1e-3, is_held=is_held)
            last_ms = now_ms
            await asyncio.sleep(FRAME_S)

    async def _drive(self, side: str, sign: int, ramp: Ramp, elapsed_s: float, *, is_held: bool) -> None:
        """One frame; the ramp goes on while its pulses are at the speed controller."""
        offset_us = sign * ramp.offset_us if is_held else 0.0
        pulses = (offset_us, 0.0) if side == "left" else (0.0, offset_us)
        status = await self._bench.send(*pulses, is_armed=is_held)
        if is_held and is_driven(status):
            ramp.advance(elapsed_s)
        word = _word_of(status, is_held)
        line = f"\r{sign * ramp.offset_us:+6.0f} us  {word:<40}"
        if line != self._shown:
            self._say(line)
            self._shown = line

    def _pressed(self) -> list[str]:
        """The keys since the last time. Raises GaveUp."""
        pressed = [self._keys.get_nowait() for _ in range(self._keys.qsize())]
        if "q" in pressed:
            raise GaveUp
        return ["\n" if key == "\r" else key for key in pressed]

    def _say(self, text: str) -> None:
        sys.stdout.write(text)
        sys.stdout.flush()


def _word_of(status: McuStatus | None, is_held: bool) -> str:
    """What the thruster does, or what keeps it still."""
    held = holds_text(status)
    if held:
        return f"held by {held}"
    if status is None:
        return "no answer"
    if not is_held:
        return "still"
    return "turning" if is_driven(status) else "not armed: let go, then hold again"


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="paani calibrate thrusters",
        description="Direction, trim and deadband of both thrusters, one at a time, while a key is held. Boat tied up.",
    )
    parser.add_argument(
        "--out",
        type=output_file("--out"),
        required=True,
        metavar="FILE",
        help="write the thrusters section here (TOML)",
    )
    add_config_arguments(parser)
    return parser
