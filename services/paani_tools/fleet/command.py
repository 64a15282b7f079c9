"""`paani fleet`: what many vessels do, and STOP for one or all of them."""

from __future__ import annotations

import argparse
import asyncio
import sys
from collections.abc import Sequence

import msgspec

from paani.clock import MonotonicClock, WallClock
from paani.config import BusConfig
from paani.errors import UserError
from paani.idle_options import refuse_options
from paani.option_numbers import whole_number
from paani.option_paths import input_file
from paani_tools.fleet.fleet_file import read_fleet
from paani_tools.fleet.page import HOST, serve_page
from paani_tools.fleet.shore import Vessel, stop_vessels, watch_fleet
from paani_tools.fleet.vessel_state import Contact, fleet_table

PORT = 8044  # beside a vessel's page
HEAR_S = 5.0  # within which a vessel that is there is heard, its router's session included
POLL_S = 0.05


def main(argv: list[str]) -> int:
    """Exit codes: 0 all vessels are live, or have latched the STOP; 1 one is or has not; 2 user's mistake."""
    parser = _parser()
    options = parser.parse_args(argv)
    if options.list or options.json or options.stop or options.stop_all:
        refuse_options(parser, options, ("--port",), "is of the page, which is not served then")
    fleet = read_fleet(options.fleet)
    names = [config.vessel for config in fleet]
    for name in options.stop:
        if name not in names:
            raise UserError(f"--stop {name}: no such vessel in {options.fleet} (have: {', '.join(names)})")
    if options.stop or options.stop_all:
        return asyncio.run(_stop(fleet, options.stop or names))
    if options.list or options.json:
        return asyncio.run(_list(fleet, options.json))
    return asyncio.run(_serve(fleet, options.port))


async def _serve(fleet: Sequence[BusConfig], port: int) -> int:
    """The page, until Ctrl-C."""
    async with watch_fleet(fleet, WallClock()) as vessels:
        await serve_page(vessels, port, _say_where)
    return 0


def _say_where(port: int) -> None:
    sys.stderr.write(f"the fleet: http://{HOST}:{port}\n")


async def _list(fleet: Sequence[BusConfig], as_json: bool) -> int:
    async with watch_fleet(fleet, WallClock()) as vessels:
        await _hear(vessels)
        states = [vessel.state for vessel in vessels]
    if as_json:
        sys.stdout.write(msgspec.json.encode(states).decode() + "\n")
    else:
        sys.stdout.write(fleet_table(states))
    return int(any(state.contact is not Contact.LIVE for state in states))


async def _stop(fleet: Sequence[BusConfig], names: Sequence[str]) -> int:
    asked = [config for config in fleet if config.vessel in names]
    async with watch_fleet(asked, WallClock()) as vessels:
        answers = await asyncio.gather(*(_stop_one(vessel) for vessel in vessels))
    sys.stdout.write("".join(f"{text}\n" for text, _ in answers))
    return int(not all(is_latched for _, is_latched in answers))


async def _stop_one(vessel: Vessel) -> tuple[str, bool]:
    """As soon as it is heard: nobody waits for the others."""
    await _hear((vessel,))
    state = (await stop_vessels((vessel,)))[vessel.name]
    if state is None:
        contact = vessel.state.contact
        return f"{vessel.name}: NOT LATCHED ({contact.value}): nobody there answers", False
    kept = "" if state.latch_kept else "; the latch could NOT be written to disk"
    return f"{vessel.name}: stopped, by {state.by}{kept}", True


async def _hear(vessels: Sequence[Vessel]) -> None:
    """Wait until every vessel was heard of its operator's process, or for HEAR_S."""
    clock = MonotonicClock()
    begun_us = clock.now_us()
    while any(vessel.state.stopped is None for vessel in vessels):
        if clock.now_us() - begun_us > HEAR_S * 1e6:
            return
        await asyncio.sleep(POLL_S)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="paani fleet", description="What many vessels do, and STOP for one or all of them, from the shore."
    )
    parser.add_argument("fleet", type=input_file(), metavar="FILE", help="the vessels, in TOML")
    acts = parser.add_mutually_exclusive_group()
    acts.add_argument("--list", action="store_true", help="one line for each vessel, as now, and no page")
    acts.add_argument("--json", action="store_true", help="the same, for a program")
    acts.add_argument("--stop", nargs="+", default=[], metavar="VESSEL", help="STOP these")
    acts.add_argument("--stop-all", action="store_true", help="STOP every vessel")
    parser.add_argument("--port", type=whole_number(0, 65535), default=PORT, help=f"of the page (default: {PORT})")
    return parser
