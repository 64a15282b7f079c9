"""What `paani up` shows: one updating line on a terminal while it waits, plain lines otherwise."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from typing import TextIO

CLEAR = "\r\x1b[K"


class Display:
    """Writes to one stream."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._updating = stream.isatty()
        self._shown = ""

    def print_line(self, line: str) -> None:
        """One line that stays."""
        self._write(f"{CLEAR}{line}\n" if self._updating and self._shown else f"{line}\n")
        self._shown = ""

    def waiting(self, alive: int, total: int, missing: Sequence[str], elapsed_s: float) -> None:
        """Progress of the start. On a plain stream a line appears only when the number alive changes."""
        names = ", ".join(missing)
        if self._updating:
            width = shutil.get_terminal_size().columns - 1  # a longer line goes on in the next, which nothing clears
            self._write(CLEAR + f"starting  {alive}/{total}  {elapsed_s:4.1f} s  waiting for {names}"[:width])
            self._shown = names
        elif names != self._shown:
            self._write(f"starting  {alive}/{total}  {elapsed_s:4.1f} s  waiting for {names}\n")
            self._shown = names

    def _write(self, text: str) -> None:
        self._stream.write(text)
        self._stream.flush()
