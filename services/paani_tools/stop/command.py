"""`paani stop`."""

from __future__ import annotations

import argparse
import asyncio
import sys

from msgspec.structs import replace

from paani import keys
from paani import messages as m
from paani.authority import has_password
from paani.bus import Bus, Latest, open_bus
from paani.cli import add_config_arguments, config_from
from paani.clock import Clock, WallClock
from paani.config import BusConfig, Config
from paani.errors import UserError
from paani.operator_client import OperatorClient

CLIENT = "stop"
JOIN_S, LATCH_S, ZERO_S = 3.0, 2.0, 2.0


def main(argv: list[str]) -> int:
    """Exit codes: 0 the boat reports zero thrust and the STOP is latched, 1 not so, 2 user's mistake."""
    parser = argparse.ArgumentParser(
        prog="paani stop",
        description="STOP the boat, past the page: asks the operator's process over the bus, and waits for a zero.",
    )
    add_config_arguments(parser)
    return asyncio.run(_stop(config_from(parser.parse_args(argv))))


async def _stop(config: Config) -> int:
    clock = WallClock()
    begun_us = clock.now_us()
    bus = await _join(config.bus, clock)
    try:
        return await _stop_on(bus, clock, begun_us)
    finally:
        await bus.close()


async def _join(config: BusConfig, clock: Clock) -> Bus:
    """The boat's bus, whatever its profile: whoever stops a boat need not name that.

    The passwords of each graph are tried at once, as one that is refused takes seconds. Raises UserError.
    """
    others = (replace(config, graph=graph) for graph in keys.Graph if graph is not config.graph)
    graphs = [config, *(each for each in others if not config.certificates and has_password(each, CLIENT))]
    joining = [asyncio.create_task(open_bus(each, CLIENT, clock)) for each in graphs]
    fault = f"bus.router {config.router}: no router answers (is the boat's loop up?)"
    try:
        for joined in asyncio.as_completed(joining, timeout=JOIN_S):
            try:
                return await joined
            except UserError as error:
                fault = str(error)
    except TimeoutError:
        pass
    finally:
        for each in joining:
            each.cancel()
    raise UserError(fault)


async def _stop_on(bus: Bus, clock: Clock, begun_us: int) -> int:
    applied = bus.latest(keys.THRUST_APPLIED)
    state = await OperatorClient(bus, clock).stop(LATCH_S)
    zero_s = await _zero_after_s(applied, begun_us)
    thrust = "the boat has not reported zero thrust" if zero_s is None else f"zero thrust after {zero_s:.2f} s"
    if state is None:
        sys.stdout.write(f"NOT LATCHED: the operator's process does not answer; {thrust}\n")
        return 1
    kept = "" if state.latch_kept else "; the latch could NOT be written to disk"
    sys.stdout.write(f"stopped: {thrust}{kept}\n")
    return 1 if zero_s is None else 0


async def _zero_after_s(applied: Latest[m.ThrustApplied], begun_us: int) -> float | None:
    """Seconds from the command's start to the first report of zero thrust after the STOP; None: there was none."""
    try:
        async with asyncio.timeout(ZERO_S):
            while True:
                report = await applied.next()
                if report.left == 0.0 and report.right == 0.0:
                    return (applied.received_us - begun_us) * 1e-6
    except TimeoutError:
        return None
