"""The log of a process stays small, whatever repeats, and says what it left out."""

from __future__ import annotations

import io
import logging

import pytest

from paani.clock import ManualClock
from paani.log_limit import MAX_LINES, MAX_OF_A_KIND, WINDOW_S, LogLimit


class Log:
    """A logger of its own, and what it has written."""

    def __init__(self) -> None:
        self.clock, self.stream = ManualClock(), io.StringIO()
        self.logger = logging.getLogger(f"boat.{id(self)}")
        self.logger.propagate = False
        handler = logging.StreamHandler(self.stream)
        handler.addFilter(LogLimit(self.clock))
        self.logger.addHandler(handler)

    @property
    def lines(self) -> list[str]:
        return self.stream.getvalue().splitlines()


@pytest.mark.slow
def test_of_a_kind_a_few_lines_are_written_and_the_rest_counted() -> None:
    log = Log()
    for number in range(10_000):
        log.logger.warning("bad request %d", number)
    log.logger.warning("something else")
    assert len(log.lines) == MAX_OF_A_KIND + 1
    assert log.lines[-1] == f"({10_000 - MAX_OF_A_KIND} lines left out) something else"
    log.clock.advance(WINDOW_S)
    log.logger.warning("bad request %d", 10_000)
    assert log.lines[-1] == "bad request 10000"


@pytest.mark.slow
def test_a_flood_of_many_kinds_is_bounded_too() -> None:
    log = Log()
    for number in range(10_000):
        log.logger.error(f"kind {number}")  # noqa: G004  # each is a kind of its own
    assert len(log.lines) == MAX_LINES
