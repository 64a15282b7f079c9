"""`paani lookout`: a line whenever the advised direction of a running boat changes."""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import sys

from paani import keys
from paani.authority import OBSERVER
from paani.bus import open_bus
from paani.cli import add_config_arguments, config_from
from paani.clock import WallClock
from paani.config import Config
from paani.messages import Direction


def main(argv: list[str]) -> int:
    """Listen until Ctrl-C, or for as long as asked. Exit code 0."""
    parser = argparse.ArgumentParser(prog="paani lookout", description=__doc__)
    parser.add_argument("--for", dest="seconds", type=float, metavar="S", help="stop after S seconds")
    add_config_arguments(parser)
    options = parser.parse_args(argv)
    with contextlib.suppress(TimeoutError):
        asyncio.run(_listen(config_from(options), options.seconds))
    return 0


async def _listen(config: Config, seconds: float | None) -> None:
    bus = await open_bus(config.bus, OBSERVER, WallClock())  # an observer reads everything and writes nothing
    try:
        advisories = bus.latest(keys.ADVISORY)
        last: Direction | None = None
        async with asyncio.timeout(seconds):
            while True:
                advice = await advisories.next()
                if advice.direction is not last:
                    sys.stdout.write(f"{advice.direction:12} {advice.explanation}\n")
                    sys.stdout.flush()
                    last = advice.direction
    finally:
        await bus.close()
