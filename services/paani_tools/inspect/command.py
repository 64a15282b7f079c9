"""`paani topics`, `paani echo`, `paani hz`."""

from __future__ import annotations

import argparse
import asyncio
import math
import sys

import msgspec

from paani.cli import add_config_arguments, config_from
from paani.clock import stopwatch_ms
from paani.config import BusConfig
from paani.option_numbers import seconds, whole_number
from paani_tools.inspect.listen import is_up, messages, observer, rates
from paani_tools.inspect.topic_table import topic_named, topics_markdown, topics_text

COUNT_S = 3.0


def topics(argv: list[str]) -> int:
    """The table of keys, with live rates when a bus is up."""
    parser = argparse.ArgumentParser(prog="paani topics", description="The table of keys; with rates if a bus is up.")
    parser.add_argument("--markdown", action="store_true", help="as the contract's README shows it")
    add_config_arguments(parser)
    options = parser.parse_args(argv)
    text = topics_markdown() if options.markdown else topics_text(asyncio.run(_live_rates(config_from(options).bus)))
    sys.stdout.write(text)
    return 0


def echo(argv: list[str]) -> int:
    """Messages of one topic, one JSON line each."""
    parser = argparse.ArgumentParser(prog="paani echo", description="Messages of one topic, one JSON line each.")
    parser.add_argument("topic", help="for example advisor/advisory, health/plant")
    parser.add_argument("--count", type=whole_number(), metavar="N", help="stop after N messages")
    add_config_arguments(parser)
    options = parser.parse_args(argv)
    asyncio.run(_echo(config_from(options).bus, options.topic, options.count))
    return 0


def hz(argv: list[str]) -> int:
    """The rate at which messages of one topic arrive."""
    parser = argparse.ArgumentParser(prog="paani hz", description="How often messages of one topic arrive.")
    parser.add_argument("topic", help="for example perception/evidence")
    parser.add_argument("--for", dest="seconds", type=seconds, metavar="S", help="stop after S seconds")
    add_config_arguments(parser)
    options = parser.parse_args(argv)
    asyncio.run(_hz(config_from(options).bus, options.topic, options.seconds or math.inf))
    return 0


async def _live_rates(config: BusConfig) -> dict[str, float] | None:
    if not await is_up(config):
        return None
    async with observer(config) as bus:
        return await rates(bus, COUNT_S)


async def _echo(config: BusConfig, name: str, count: int | None) -> None:
    topic = topic_named(name)
    printed = 0
    async with observer(config) as bus:
        async for message in messages(bus, topic):
            sys.stdout.write(msgspec.json.encode(message).decode() + "\n")
            sys.stdout.flush()
            printed += 1
            if count is not None and printed >= count:
                return


async def _hz(config: BusConfig, name: str, seconds: float) -> None:
    topic = topic_named(name)
    arrivals = Arrivals()
    async with observer(config) as bus, asyncio.TaskGroup() as group:

        async def note() -> None:
            async for _ in messages(bus, topic):
                arrivals.add(stopwatch_ms())

        noting = group.create_task(note())
        left_s = seconds
        while left_s > 0:
            await asyncio.sleep(min(1.0, left_s))
            left_s -= 1.0
            sys.stdout.write(f"{arrivals.text(stopwatch_ms(), topic.rate_hz)}\n")
            sys.stdout.flush()
        noting.cancel()


class Arrivals:
    """When messages of one topic arrived [ms]."""

    def __init__(self) -> None:
        self._count = 0
        self._first_ms = self._last_ms = 0.0
        self._least_gap_ms, self._largest_gap_ms = math.inf, 0.0

    def add(self, at_ms: float) -> None:
        if self._count:
            gap_ms = at_ms - self._last_ms
            self._least_gap_ms = min(self._least_gap_ms, gap_ms)
            self._largest_gap_ms = max(self._largest_gap_ms, gap_ms)
        else:
            self._first_ms = at_ms
        self._last_ms = at_ms
        self._count += 1

    def text(self, now_ms: float, nominal_hz: float) -> str:
        """Mean rate and spread of the gaps so far; a silence longer than any of them counts in the rate."""
        silent_ms = now_ms - self._last_ms if self._count else 0.0
        is_silent = silent_ms > max(self._largest_gap_ms, 1e3 / nominal_hz)
        silence = f", silent for {silent_ms * 1e-3:.1f} s" if is_silent else ""
        if self._count < 2:
            return f"{self._count} messages (nominal {nominal_hz:g} Hz){silence}"
        span_ms = (now_ms if is_silent else self._last_ms) - self._first_ms
        return (
            f"{1e3 * (self._count - 1) / span_ms:.2f} Hz (nominal {nominal_hz:g} Hz),"
            f" gaps {self._least_gap_ms:.0f} to {self._largest_gap_ms:.0f} ms, {self._count} messages{silence}"
        )
