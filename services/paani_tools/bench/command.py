"""`paani bench chain`, `judgement`, `planner`, `recorder`, and those of other packages."""

from __future__ import annotations

import argparse
import asyncio
import os
import sys
from collections.abc import Callable
from tempfile import TemporaryDirectory

import msgspec

from paani.cli import add_config_arguments, config_from
from paani.errors import UserError
from paani.option_numbers import seconds, whole_number
from paani.option_paths import input_path, output_file, require_apart
from paani.statistics.figure_table import FigureTable, installed_commands, installed_tables, table_text
from paani.statistics.measured import Machine, Report, measure_tables
from paani.whole_file import write_whole
from paani_tools.bench.chain import chain_bench, chain_text
from paani_tools.bench.judgement import contract, step
from paani_tools.bench.planner import plan_among_obstacles, plan_recorded
from paani_tools.bench.recording_cost import recorder
from paani_tools.bench.steadiness import steadiness
from paani_tools.replay.speed import measure_replay
from paani_tools.up.command import up_sets
from paani_tools.up.lifecycle import Outcome, run_plan
from paani_tools.up.plan import make_plan
from paani_tools.up.terminal import Display


def main(argv: list[str]) -> int:
    """Run one benchmark and print its figures.

    Without `PAANI_RUNTIME_DIR` or `bus.runtime_dir` a benchmark's boat has a runtime folder that ends with it, so that
    neither meets the STOP latch of the user's own boat.
    """
    with TemporaryDirectory(prefix="paani-bench-") as folder:
        os.environ.setdefault("PAANI_RUNTIME_DIR", folder)
        try:
            return _main(argv)
        finally:
            if os.environ.get("PAANI_RUNTIME_DIR") == folder:
                del os.environ["PAANI_RUNTIME_DIR"]


def _main(argv: list[str]) -> int:
    others = installed_commands()
    if argv and argv[0] in others:
        return int(others[argv[0]].load()(argv[1:]))
    if argv and not argv[0].startswith("-") and argv[0] not in BENCHES:
        raise UserError(f"bench {argv[0]}: no such bench (have: {', '.join([*BENCHES, *others])})")
    parser = argparse.ArgumentParser(
        prog="paani bench",
        description="Measure, and print the figures side by side.",
        epilog=f"`paani bench NAME --help` says more of each of: {', '.join(others)}.",
    )
    benches = parser.add_subparsers(dest="what", required=True, metavar=" | ".join([*BENCHES, *others]))
    chain = benches.add_parser("chain", help="the whole loop, from the picture to the thrust")
    chain.add_argument("--world", help="river or lake (default: river)")
    chain.add_argument("--for", dest="seconds", type=seconds, default=30.0, metavar="S", help="default: 30")
    chain.add_argument("--json", action="store_true", help="print JSON; progress goes to standard error")
    add_config_arguments(chain)
    judgement = benches.add_parser("judgement", help="the advisor: its step, its counterfactuals, its messages")
    judgement.add_argument("--json", type=output_file("--json"), metavar="FILE", help="write the figures there too")
    judgement.add_argument(
        "--frames", type=whole_number(), default=1000, metavar="N", help="frames to step over; default: 1000"
    )
    judgement.add_argument(
        "--drive",
        type=input_path("--drive"),
        action="append",
        default=[],
        metavar="LOG",
        help="count changes of direction on recordings, and decide them again",
    )
    judgement.add_argument("--only", action="append", default=[], metavar="PART", help="these parts alone")
    add_config_arguments(judgement)
    planning = benches.add_parser("planner", help="the navigator's map and plan among 12 moving obstacles")
    planning.add_argument("--steps", type=whole_number(), default=300, metavar="N", help="to plan; default: 300")
    planning.add_argument(
        "--drive",
        type=input_path("--drive"),
        action="append",
        default=[],
        metavar="LOG",
        help="plan these recordings again as well",
    )
    planning.add_argument("--json", type=output_file("--json"), metavar="FILE", help="write the figures there too")
    add_config_arguments(planning)
    recording = benches.add_parser("recorder", help="what recording a drive costs")
    recording.add_argument("--for", dest="seconds", type=seconds, default=30.0, metavar="S", help="default: 30")
    recording.add_argument("--json", type=output_file("--json"), metavar="FILE", help="write the figures there too")
    add_config_arguments(recording)
    options = parser.parse_args(argv)
    if options.json and options.what in {"judgement", "planner"}:
        require_apart({"--json": options.json}, options.drive)
    return BENCHES[options.what](options)


def _chain(options: argparse.Namespace) -> int:
    """Run the whole loop, headless, and print where the time goes. Exit codes as `paani up`."""
    cores, load_before = os.cpu_count() or 1, os.getloadavg()[0]
    outcome = asyncio.run(_run(options))
    machine = Machine(cores=cores, load_before=round(load_before, 2), load_after=round(os.getloadavg()[0], 2))
    bench = chain_bench(outcome.report, machine)
    sys.stdout.write(msgspec.json.encode(bench).decode() + "\n" if options.json else "\n" + chain_text(bench))
    if outcome.failure:
        sys.stderr.write(f"paani: {outcome.failure}\n")
        return 1
    return 0


async def _run(options: argparse.Namespace) -> Outcome:
    sets = up_sets(world=options.world, camera=None, headless=True)
    plan = await make_plan(config_from(options, sets))
    return await run_plan(plan, options.seconds, Display(sys.stderr if options.json else sys.stdout))


def _judgement(options: argparse.Namespace) -> int:
    """Print each part as it is done. Raises UserError for a drive that cannot be read or a file not written."""
    config = config_from(options)
    parts: dict[str, Callable[[], FigureTable]] = {
        "step": lambda: step(config, options.frames),
        "contract": lambda: contract(config, options.frames),
    }
    if options.drive:
        parts["dithering"] = lambda: steadiness(options.drive)
        parts["replay"] = lambda: measure_replay(options.drive)
    parts |= installed_tables()
    for name in options.only:
        if name not in parts:
            raise UserError(f"--only {name}: no such part (have: {', '.join(parts)})")
    report = measure_tables(parts[name] for name in options.only or parts)
    if options.json:
        write_whole(options.json, msgspec.json.encode(report) + b"\n", "--json")
    return 0


def _planner(options: argparse.Namespace) -> int:
    """Print each part as it is done. Raises UserError for a log that cannot be read or a file not written."""
    config = config_from(options)
    parts = [lambda: plan_among_obstacles(config, options.steps)]
    if options.drive:
        parts.append(lambda: plan_recorded(options.drive))
    report = measure_tables(parts)
    if options.json:
        write_whole(options.json, msgspec.json.encode(report) + b"\n", "--json")
    return 0


def _recorder(options: argparse.Namespace) -> int:
    """Drive, record, print. Exit codes as `paani up`."""
    cores, load_before = os.cpu_count() or 1, os.getloadavg()[0]
    part, failure = recorder(options, Display(sys.stdout))
    if failure:
        sys.stderr.write(f"paani: {failure}\n")
        return 1
    machine = Machine(cores=cores, load_before=round(load_before, 2), load_after=round(os.getloadavg()[0], 2))
    sys.stdout.write("\n" + table_text(part))
    sys.stdout.write(
        f"\n{machine.cores} cores, load {machine.load_before:.2f} before and {machine.load_after:.2f} after\n"
    )
    if options.json:
        write_whole(options.json, msgspec.json.encode(Report(machine=machine, parts=(part,))) + b"\n", "--json")
    return 0


BENCHES: dict[str, Callable[[argparse.Namespace], int]] = {
    "chain": _chain, "judgement": _judgement, "planner": _planner, "recorder": _recorder,
}  # fmt: skip
