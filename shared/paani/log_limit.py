"""Keeps one process's log small, whatever repeats: lines beyond a few of a kind are counted, not written."""

from __future__ import annotations

import logging

from paani.clock import Clock, MonotonicClock

WINDOW_S = 10.0
MAX_OF_A_KIND = 5  # in a window; a kind is a logger, a level and the text before its values are filled in
MAX_LINES = 50  # in a window, of all kinds


class LogLimit(logging.Filter):
    """A filter of a handler. The first line of the next window says how many were left out."""

    def __init__(self, clock: Clock | None = None) -> None:
        super().__init__()
        self._clock = clock or MonotonicClock()
        self._begun_us = self._clock.now_us()
        self._kinds: dict[tuple[str, int, str], int] = {}
        self._lines = self._left_out = 0

    def filter(self, record: logging.LogRecord) -> bool:
        """Whether to write this line."""
        now_us = self._clock.now_us()
        if (now_us - self._begun_us) * 1e-6 >= WINDOW_S:
            self._begun_us, self._kinds, self._lines = now_us, {}, 0
        kind = (record.name, record.levelno, str(record.msg))
        count = self._kinds.get(kind, 0)
        if count >= MAX_OF_A_KIND or self._lines >= MAX_LINES:
            self._left_out += 1
            return False
        self._kinds[kind] = count + 1
        self._lines += 1
        if self._left_out:
            record.msg = f"({self._left_out} lines left out) {record.msg}"
            self._left_out = 0
        return True
