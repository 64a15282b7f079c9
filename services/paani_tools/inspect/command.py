"""`paani topics`, `paani echo`, `paani hz`."""

from __future__ import annotations

import argparse
import asyncio
import itertools
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
    arrivals_ms: list[float] = []
    async with observer(config) as bus, asyncio.TaskGroup() as group:

        async def note() -> None:
            async for _ in messages(bus, topic):
                arrivals_ms.append(stopwatch_ms())

        noting = group.create_task(note())
        left_s = seconds
        while left_s > 0:
            await asyncio.sleep(min(1.0, left_s))
            left_s -= 1.0
            sys.stdout.write(f"{rate_line(arrivals_ms, topic.rate_hz)}\n")
            sys.stdout.flush()
        noting.cancel()


def rate_line(arrivals_ms: list[float], nominal_hz: float) -> str:
    """Mean rate and spread of the gaps between arrivals so far."""
    gaps_ms = [after - before for before, after in itertools.pairwise(arrivals_ms)]
    if not gaps_ms:
        return f"{len(arrivals_ms)} messages (nominal {nominal_hz:g} Hz)"
    mean_ms = sum(gaps_ms) / len(gaps_ms)
    return (
        f"{1e3 / mean_ms:.2f} Hz (nominal {nominal_hz:g} Hz), gaps {min(gaps_ms):.0f} to {max(gaps_ms):.0f} ms, "
        f"{len(arrivals_ms)} messages"
    )
