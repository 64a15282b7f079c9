"""Keys of the operator's terminal, each when it comes, without an echo and without waiting for a line."""

from __future__ import annotations

import asyncio
import contextlib
import os
import sys
import termios
import tty
from collections.abc import Iterator

from paani.errors import UserError


@contextlib.contextmanager
def raw_keys() -> Iterator[asyncio.Queue[str]]:
    """The keys of standard input, until the end; Ctrl-C still interrupts. Raises UserError where it is no terminal."""
    if sys.stdin is None or not sys.stdin.isatty():
        raise UserError("paani calibrate thrusters needs a terminal: somebody holds a key while a thruster turns")
    fd = sys.stdin.fileno()
    before, loop = termios.tcgetattr(fd), asyncio.get_running_loop()
    keys: asyncio.Queue[str] = asyncio.Queue()

    def read() -> None:
        data = os.read(fd, 256)
        for key in data.decode(errors="replace") if data else "q":  # the terminal is gone: so is the operator
            keys.put_nowait(key.lower())
        if not data:
            loop.remove_reader(fd)

    try:
        tty.setcbreak(fd)
        termios.tcflush(fd, termios.TCIFLUSH)  # what was typed before is no answer
        loop.add_reader(fd, read)
        yield keys
    finally:
        loop.remove_reader(fd)
        termios.tcsetattr(fd, termios.TCSADRAIN, before)
