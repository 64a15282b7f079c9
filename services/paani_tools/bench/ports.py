"""`paani bench ports`: what the ports to other programs take, and whether the loop decides as often beside them."""

from __future__ import annotations

import argparse
import asyncio
import os
import sys
from collections.abc import Mapping, Sequence
from statistics import fmean

import msgspec

from paani.cli import add_config_arguments, config_from
from paani.config import Config
from paani.keys import PORTS
from paani.option_numbers import whole_number
from paani.option_paths import output_file
from paani.statistics.order_statistics import median
from paani.whole_file import write_json
from paani_tools.up.command import seconds, up_sets
from paani_tools.up.lifecycle import run_plan
from paani_tools.up.plan import make_plan
from paani_tools.up.run_summary import Report, ServiceFigures
from paani_tools.up.terminal import Display

MAX_LOSS = 0.03  # of the decision rate


class PortsReport(msgspec.Struct, frozen=True, kw_only=True):
    """`ratios`: decisions a second with the ports over without them, of each round. `ports`: of each run with them."""

    driven_s: float
    ratios: tuple[float, ...]
    decisions_hz: tuple[float, ...]
    ports: dict[str, tuple[ServiceFigures, ...]]


def main(argv: list[str]) -> int:
    """Exit codes: 0 the loop decides as often within 3 %, 1 it does not or a port fell, 2 user's mistake."""
    parser = argparse.ArgumentParser(
        prog="paani bench ports", description="Drive without ports and with them in turn; what do they take?"
    )
    parser.add_argument("--ports", nargs="+", choices=PORTS, default=PORTS, help="these alone; default: all")
    parser.add_argument("--for", dest="seconds", type=seconds, default=30.0, metavar="S", help="each; default: 30")
    parser.add_argument("--rounds", type=whole_number(), default=3, metavar="N", help="pairs of drives; default: 3")
    parser.add_argument("--json", type=output_file("--json"), metavar="FILE", help="write the figures there too")
    add_config_arguments(parser)
    options = parser.parse_args(argv)
    own = up_sets(world=None, camera=None, headless=True)
    without = config_from(options, own)
    with_ports = config_from(options, (*own, *up_sets(world=None, camera=None, headless=True, ports=options.ports)))
    report = asyncio.run(_measure(without, with_ports, options.ports, options.rounds, options.seconds))
    sys.stdout.write("\n" + ports_text(report))
    if options.json:
        write_json(options.json, report, "--json")
    return 0 if keeps_bars(report) else 1


def keeps_bars(report: PortsReport) -> bool:
    """The median ratio is within 3 % of one or above it, and no port was started again."""
    fell = any(figures.restarts for runs in report.ports.values() for figures in runs)
    return median(report.ratios) >= 1.0 - MAX_LOSS and not fell


def ports_report(driven_s: float, ports: Sequence[str], rounds: Sequence[tuple[Report, Report]]) -> PortsReport:
    """Figures of rounds, each a drive without the ports and one with them."""
    rates = [(_decisions_hz(without), _decisions_hz(beside)) for without, beside in rounds]
    return PortsReport(
        driven_s=driven_s,
        ratios=tuple(beside / without for without, beside in rates),
        decisions_hz=tuple(rate for pair in rates for rate in pair),
        ports={name: tuple(beside.services[name] for _, beside in rounds) for name in ports},
    )


def ports_text(report: PortsReport) -> str:
    """The table, and the loop's rate beside it."""
    lines = ["| port | CPU [% of a core] | RSS [MiB] |", "|---|---|---|"]
    lines += [
        f"| {name} | {100.0 * fmean(each.cpu_cores for each in runs):.1f} | {max(each.rss_mib for each in runs):.0f} |"
        for name, runs in report.ports.items()
    ]
    ratios = ", ".join(f"{ratio:.3f}" for ratio in report.ratios)
    return "\n".join(lines) + (
        f"\n\n{len(report.ratios)} pairs of {report.driven_s:.0f} s; decisions/s with the ports over without: {ratios};"
        f" {os.cpu_count()} cores; no client at the ports\n"
    )


async def _measure(
    without: Config, with_ports: Config, ports: Sequence[str], rounds: int, driven_s: float
) -> PortsReport:
    """Pairs of drives, one after the other; every second pair begins with the ports."""
    found = []
    for number in range(rounds):
        reports: Mapping[bool, Report] = {
            beside: await _drive(with_ports if beside else without, driven_s)
            for beside in ((False, True) if number % 2 == 0 else (True, False))
        }
        found.append((reports[False], reports[True]))
    return ports_report(driven_s, ports, found)


async def _drive(config: Config, driven_s: float) -> Report:
    outcome = await run_plan(await make_plan(config), driven_s, Display(sys.stdout))
    return outcome.report


def _decisions_hz(report: Report) -> float:
    return sum(report.decisions.values()) / max(report.duration_s, 1e-9)
