"""A line on standard error that says how far a long reading is; nothing where nobody watches."""

from __future__ import annotations

import sys
from types import TracebackType

from paani.clock import stopwatch_ms

EVERY_MS = 100.0
WIDTH = 30


class Progress:
    """`at` shows a fraction in [0, 1]; the line is wiped at the end of the context."""

    def __init__(self, what: str) -> None:
        self._what = what
        self._shown_ms = -EVERY_MS
        self._watched = sys.stderr.isatty()

    def __enter__(self) -> Progress:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._watched:
            sys.stderr.write("\r\x1b[K")

    def at(self, frac: float, text: str = "") -> None:
        """Show it, at most ten times a second."""
        if not self._watched or stopwatch_ms() - self._shown_ms < EVERY_MS:
            return
        self._shown_ms = stopwatch_ms()
        frac = min(1.0, max(0.0, frac))
        bar = "#" * round(frac * WIDTH)
        sys.stderr.write(f"\r\x1b[K{self._what} [{bar:<{WIDTH}}] {100 * frac:3.0f} %  {text}")
        sys.stderr.flush()
