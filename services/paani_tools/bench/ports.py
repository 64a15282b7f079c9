"""`paani bench ports`: what the ports to other programs take with a client at each, and how late they tell and obey."""

from __future__ import annotations

import argparse
import asyncio
import functools
import os
import sys
from collections.abc import Awaitable, Callable, Mapping, Sequence
from statistics import fmean
from typing import NamedTuple

import msgspec

from paani.cli import add_config_arguments, config_from
from paani.clock import WallClock
from paani.config import Config
from paani.keys import PORTS
from paani.option_numbers import seconds, whole_number
from paani.option_paths import output_file
from paani.statistics.order_statistics import median
from paani.whole_file import write_json
from paani_tools.up.command import up_sets
from paani_tools.up.lifecycle import run_plan
from paani_tools.up.plan import make_plan
from paani_tools.up.run_summary import Percentiles, Report, ServiceFigures, percentiles
from paani_tools.up.terminal import Display

STEERING_PORTS = ("mavlink", "ros2")  # in this order: ROS 2 takes the wheel from whoever holds it
MAX_LOSS = 0.03  # of the decision rate


class StickLatencies(NamedTuple):
    """From each stick to the thrust that follows it [s]; unanswered: sticks that none followed in time."""

    latencies_s: list[float]
    unanswered: int


class PortsReport(msgspec.Struct, frozen=True, kw_only=True):
    """`ratios`: decisions a second with the ports over without them, of each round. `ports`: of each run with them.

    `age_ms`: of telemetry at the client, since it was measured aboard. `command_ms`: from a stick at the client to the
    thrust adapter's report of the thrust that follows it; `unanswered`: sticks that none followed.
    """

    driven_s: float
    ratios: tuple[float, ...]
    decisions_hz: tuple[float, ...]
    ports: dict[str, tuple[ServiceFigures, ...]]
    age_ms: dict[str, Percentiles] = {}
    command_ms: dict[str, Percentiles] = {}
    unanswered: dict[str, int] = {}


def main(argv: list[str]) -> int:
    """Exit codes: 0 the loop decides as often within 3 %, 1 it does not or a port fell, 2 user's mistake."""
    parser = argparse.ArgumentParser(
        prog="paani bench ports",
        description="Drive without ports and with them in turn, a client at each: what they take, how late they are",
    )
    parser.add_argument("--ports", nargs="+", choices=PORTS, default=PORTS, help="these alone; default: all")
    parser.add_argument("--for", dest="seconds", type=seconds, default=30.0, metavar="S", help="each; default: 30")
    parser.add_argument("--rounds", type=whole_number(), default=3, metavar="N", help="pairs of drives; default: 3")
    parser.add_argument("--json", type=output_file("--json"), metavar="FILE", help="write the figures there too")
    parser.add_argument(
        "--sticks", type=whole_number(), default=40, metavar="N", help="turned by MAVLink and by ROS 2; default: 40"
    )
    add_config_arguments(parser)
    options = parser.parse_args(argv)
    own = up_sets(world=None, camera=None, headless=True)
    without = config_from(options, own)
    ports = up_sets(world=None, camera=None, headless=True, ports=options.ports)
    with_ports = config_from(options, (*own, *ports, "ros2.accept_commands=true"))
    report = asyncio.run(_measure(without, with_ports, options))
    sys.stdout.write("\n" + ports_text(report))
    if options.json:
        write_json(options.json, report, "--json")
    return 0 if keeps_bars(report) else 1


def keeps_rate(report: PortsReport) -> bool:
    """The median ratio is within 3 % of one, or above it."""
    return median(report.ratios) >= 1.0 - MAX_LOSS


def keeps_bars(report: PortsReport) -> bool:
    """The loop keeps its rate, no port was started again, and each was heard and obeyed."""
    fell = any(figures.restarts for runs in report.ports.values() for figures in runs)
    silent = any(figures.samples == 0 for figures in (*report.age_ms.values(), *report.command_ms.values()))
    return keeps_rate(report) and not fell and not silent


def ports_report(
    driven_s: float,
    ports: Sequence[str],
    rounds: Sequence[tuple[Report, Report]],
    ages_s: Mapping[str, Sequence[float]],
    stick_latencies: Mapping[str, StickLatencies],
) -> PortsReport:
    """Figures of rounds, each a drive without the ports and one with them; ages of telemetry; sticks."""
    rates = [(_decisions_hz(without), _decisions_hz(beside)) for without, beside in rounds]
    return PortsReport(
        driven_s=driven_s,
        ratios=tuple(beside / without for without, beside in rates),
        decisions_hz=tuple(rate for pair in rates for rate in pair),
        ports={name: tuple(beside.services[name] for _, beside in rounds) for name in ports},
        age_ms={name: percentiles(1e3 * age_s for age_s in ages) for name, ages in ages_s.items()},
        command_ms={
            name: percentiles(1e3 * each for each in found.latencies_s) for name, found in stick_latencies.items()
        },
        unanswered={name: found.unanswered for name, found in stick_latencies.items()},
    )


def ports_text(report: PortsReport) -> str:
    """The table, and the loop's rate beside it."""
    lines = [
        "| port | CPU [% of a core] | RSS [MiB] | telemetry age p50 / p95 [ms] | stick to thrust p50 / p95 [ms] |",
        "|---|---|---|---|---|",
    ]
    lines += [
        f"| {name} | {100.0 * fmean(each.cpu_cores for each in runs):.1f} | {max(each.rss_mib for each in runs):.0f} |"
        f" {_spread(report.age_ms.get(name))} | {_spread(report.command_ms.get(name))} |"
        for name, runs in report.ports.items()
    ]
    ratios = ", ".join(f"{ratio:.3f}" for ratio in report.ratios)
    return "\n".join(lines) + (
        f"\n\n{len(report.ratios)} pairs of {report.driven_s:.0f} s; decisions/s with the ports over without: {ratios};"
        f" {os.cpu_count()} cores; a client at each port; sticks that no thrust followed:"
        f" {sum(report.unanswered.values())}\n"
        f"bar: median of the ratios {median(report.ratios):.3f}, at least {1.0 - MAX_LOSS:.2f}:"
        f" {'met' if keeps_rate(report) else 'not met'}\n"
    )


def _spread(figures: Percentiles | None) -> str:
    """Median, 95th percentile, and of how many."""
    if figures is None or figures.p50 is None or figures.p95 is None:
        return "-"
    return f"{figures.p50:.0f} / {figures.p95:.0f} (n = {figures.samples})"


async def _measure(without: Config, with_ports: Config, options: argparse.Namespace) -> PortsReport:
    """Pairs of drives, one after the other, every second pair beginning with the ports; then one that is steered."""
    plan = await make_plan(with_ports)  # which says what is not installed
    from paani_tools.bench.port_clients import Watch  # noqa: PLC0415  # needs the extras of the ports
    from paani_tools.bench.port_steering import steer  # noqa: PLC0415

    clock, found, ages_s = WallClock(), [], {name: list[float]() for name in options.ports}
    for number in range(options.rounds):
        watch = Watch(with_ports, clock)
        drives = {
            False: functools.partial(_drive, without, options.seconds),
            True: functools.partial(
                _drive, with_ports, None, functools.partial(watch.run, options.ports, options.seconds)
            ),
        }
        reports = {beside: await drives[beside]() for beside in ((False, True) if number % 2 == 0 else (True, False))}
        found.append((reports[False], reports[True]))
        for name, ages in watch.ages_s.items():
            ages_s[name] += ages
    stick_latencies: dict[str, StickLatencies] = {}

    async def steer_by_each() -> None:
        for name in STEERING_PORTS:
            if name in options.ports:
                try:
                    stick_latencies[name] = await steer(with_ports, clock, name, options.sticks)
                except TimeoutError:  # MANUAL was not given; the figures of the drives are as good as they were
                    stick_latencies[name] = StickLatencies([], options.sticks)

    if set(STEERING_PORTS) & set(options.ports):
        await run_plan(plan, None, Display(sys.stdout), steer_by_each)
    return ports_report(options.seconds, options.ports, found, ages_s, stick_latencies)


async def _drive(config: Config, driven_s: float | None, during: Callable[[], Awaitable[None]] | None = None) -> Report:
    outcome = await run_plan(await make_plan(config), driven_s, Display(sys.stdout), during)
    return outcome.report


def _decisions_hz(report: Report) -> float:
    return sum(report.decisions.values()) / max(report.duration_s, 1e-9)
