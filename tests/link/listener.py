"""In the host's namespace: prints what the thrust adapter applies, and what counts on the way to it, as lines of JSON.

    python -m tests.link.listener PAANI_CONFIG_OPTIONS

All times are of the monotonic clock, which both namespaces share; so the age of a command is that at the adapter.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import queue
import sys
from typing import Any

import msgspec

from paani import keys
from paani import messages as m
from paani.authority import OBSERVER
from paani.bus import open_bus
from paani.cli import add_config_arguments, config_from
from paani.clock import MonotonicClock, WallClock

CLOCK, WALL = MonotonicClock(), WallClock()


class Applied(msgspec.Struct, tag=True):
    """`at_us`: when it was heard. Ages [ms] are those of the command in force, 0 without one.

    `inhibits`: those of the newest thrust heard by then, why it moves nothing.
    """

    at_us: int
    force_n: float
    cause: str
    command_age_ms: float
    picture_age_ms: float
    inhibits: tuple[str, ...] = ()


class Decided(msgspec.Struct, tag=True):
    """The first advisory from one picture."""

    at_us: int
    direction: str = ""
    reason: str = ""


class Dropped(msgspec.Struct, tag=True):
    """What a process of either side has refused so far, by cause."""

    at_us: int
    service: str
    drops: dict[str, int]


Line = Applied | Decided | Dropped


class Listener:
    """Turns messages into lines, on Zenoh's thread."""

    def __init__(self) -> None:
        self.lines: queue.SimpleQueue[Line] = queue.SimpleQueue()
        self._echo_us: dict[tuple[int, int], int] = {}
        self._newest_echo: dict[int, int] = {}
        self._evidence_us = 0
        self._inhibits: tuple[str, ...] = ()

    def hear_thrust(self, thrust: m.Thrust) -> None:
        self._inhibits = thrust.inhibits
        self._newest_echo[thrust.sent_us] = thrust.echo_us
        while len(self._newest_echo) > 256:
            del self._newest_echo[next(iter(self._newest_echo))]

    def hear_applied(self, applied: m.ThrustApplied) -> None:
        now_us = CLOCK.now_us()
        in_force = applied.zero_cause is m.ZeroCause.NONE
        echo_us = self._newest_echo.get(applied.command_sent_us, now_us)
        self.lines.put(
            Applied(
                at_us=now_us,
                force_n=applied.left_n + applied.right_n,
                cause=applied.zero_cause,
                command_age_ms=(now_us - echo_us) * 1e-3 if in_force else 0.0,
                picture_age_ms=(WALL.now_us() - applied.command_source_us) * 1e-3 if in_force else 0.0,
                inhibits=self._inhibits,
            )
        )

    def hear_advisory(self, advisory: m.Advisory) -> None:
        if advisory.evidence_sent_us != self._evidence_us:
            self._evidence_us = advisory.evidence_sent_us
            self.lines.put(Decided(CLOCK.now_us(), advisory.direction, advisory.reason))

    def hear_health(self, health: m.Health) -> None:
        drops = {drop.cause: drop.count for drop in health.drops}
        self.lines.put(Dropped(CLOCK.now_us(), health.service, drops))


async def listen(options: argparse.Namespace) -> None:
    """Print until standard output ends."""
    config = config_from(options)
    bus = await open_bus(config.bus, OBSERVER, WALL)
    listener = Listener()
    heard: tuple[tuple[keys.Topic[Any], Any], ...] = (
        (keys.THRUST, listener.hear_thrust),
        (keys.THRUST_APPLIED, listener.hear_applied),
        (keys.ADVISORY, listener.hear_advisory),
        *((keys.health(name), listener.hear_health) for name in keys.services_in(config.bus.graph)),
    )
    for topic, hear in heard:
        bus.on(topic, hear)
    try:
        while True:
            await asyncio.sleep(0.05)
            while not listener.lines.empty():
                sys.stdout.write(msgspec.json.encode(listener.lines.get()).decode() + "\n")
            sys.stdout.flush()
    finally:
        await bus.close()


def main() -> None:
    parser = argparse.ArgumentParser()
    add_config_arguments(parser)
    with contextlib.suppress(BrokenPipeError, KeyboardInterrupt):
        asyncio.run(listen(parser.parse_args()))


if __name__ == "__main__":
    main()
