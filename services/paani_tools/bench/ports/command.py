"""`paani bench ports`: what the ports to other programs take with a client at each, and how late they tell and obey."""

from __future__ import annotations

import argparse
import asyncio
import functools
import sys
from collections.abc import Awaitable, Callable

from paani.cli import add_config_arguments, config_from
from paani.clock import WallClock
from paani.config import Config
from paani.keys import PORTS
from paani.option_numbers import seconds, whole_number
from paani.option_paths import output_file
from paani.whole_file import write_json
from paani_tools.bench.ports.figures import PortsReport, StickLatencies, keeps_bars, ports_report, ports_text
from paani_tools.up.command import up_sets
from paani_tools.up.lifecycle import run_plan
from paani_tools.up.plan import make_plan
from paani_tools.up.run_summary import Report
from paani_tools.up.terminal import Display

STEERING_PORTS = ("mavlink", "ros2")  # in this order: ROS 2 takes the wheel from whoever holds it


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


async def _measure(without: Config, with_ports: Config, options: argparse.Namespace) -> PortsReport:
    """Pairs of drives, one after the other, every second pair beginning with the ports; then one that is steered."""
    plan = await make_plan(with_ports)  # which says what is not installed
    from paani_tools.bench.ports.clients import Watch  # noqa: PLC0415  # needs the extras of the ports
    from paani_tools.bench.ports.steering import steer  # noqa: PLC0415

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
