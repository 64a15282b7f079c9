"""`paani bench chain`."""

from __future__ import annotations

import argparse
import asyncio
import os
import sys

import msgspec

from paani.bench.table import Machine, bench_of, text_of
from paani.cli import add_config_arguments, config_from
from paani.up.command import seconds, up_sets
from paani.up.display import Display
from paani.up.drive import Outcome, drive
from paani.up.plan import make_plan


def main(argv: list[str]) -> int:
    """Run the whole loop, headless, and print where the time goes. Exit codes as `paani up`."""
    parser = argparse.ArgumentParser(prog="paani bench", description="Run the whole loop and measure it.")
    parser.add_argument("what", choices=("chain",), help="from the picture to the thrust")
    parser.add_argument("--world", help="river or lake (default: river)")
    parser.add_argument("--for", dest="seconds", type=seconds, default=30.0, metavar="S", help="default: 30")
    parser.add_argument("--json", action="store_true", help="print JSON; progress goes to standard error")
    add_config_arguments(parser)
    options = parser.parse_args(argv)
    cores, load_before = os.cpu_count() or 1, os.getloadavg()[0]
    outcome = asyncio.run(_run(options))
    machine = Machine(cores=cores, load_before=round(load_before, 2), load_after=round(os.getloadavg()[0], 2))
    bench = bench_of(outcome.report, machine)
    sys.stdout.write(msgspec.json.encode(bench).decode() + "\n" if options.json else "\n" + text_of(bench))
    if outcome.failure:
        sys.stderr.write(f"paani: {outcome.failure}\n")
        return 1
    return 0


async def _run(options: argparse.Namespace) -> Outcome:
    sets = up_sets(world=options.world, camera=None, headless=True)
    plan = await make_plan(config_from(options, sets))
    return await drive(plan, options.seconds, Display(sys.stderr if options.json else sys.stdout))
