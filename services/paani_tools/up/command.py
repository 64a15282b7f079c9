"""`paani up`."""

from __future__ import annotations

import argparse
import asyncio
import json
import sys
from collections.abc import Sequence
from pathlib import Path

from paani.cli import add_config_arguments, config_from
from paani.config import Config
from paani.errors import UserError
from paani.idle_options import refuse_options
from paani.keys import PORTS, Graph
from paani.option_numbers import seconds
from paani.option_paths import input_file, output_file, output_folder
from paani.sides import Side
from paani.whole_file import write_json
from paani_tools.up.lifecycle import Outcome, run_plan
from paani_tools.up.plan import complete_plan, make_plan
from paani_tools.up.prepare import write_plan
from paani_tools.up.run_summary import Report
from paani_tools.up.terminal import Display

DOCTOR = "`paani doctor` says what this machine lacks"


def main(argv: list[str]) -> int:
    """Exit codes: 0 it ran to its end, 1 a service could not be kept alive, 2 user's mistake."""
    parser = _parser()
    options = parser.parse_args(argv)
    if options.prepare is not None:
        refuse_options(parser, options, ("--for", "--summary"), "is not for --prepare, which starts nothing")
        asyncio.run(_prepare(options))
        return 0
    outcome = asyncio.run(_up(options))
    sys.stdout.write(_result(outcome.report))
    if options.summary is not None:
        write_json(options.summary, outcome.report, "--summary")
    if outcome.failure:
        sys.stderr.write(f"paani: {outcome.failure} ({DOCTOR})\n")
        return 1
    return 0


def up_sets(
    *,
    simulated: bool = True,
    world: str | None,
    camera: str | None,
    headless: bool,
    record: Path | None = None,
    mission: Path | None = None,
    fence: Path | None = None,
    only: str | None = None,
    ports: Sequence[str] = (),
) -> tuple[str, ...]:
    """Settings that the options of `paani up` stand for. A simulated boat is armed at start."""
    sets = ["up.arm_at_start=true"] if simulated else []
    if only is not None:
        sets.append(f"bus.side={only}")
    if world is not None:
        sets.append(f"world.name={json.dumps(world)}")
    if camera is not None:
        sets.append(f"camera.source={json.dumps(camera)}")
    if headless:
        sets.append("dashboard.serve=false")
    for field, file in (("mission", mission), ("fence", fence)):
        if file is not None:
            sets.append(f"navigator.{field}={json.dumps(str(file.absolute()))}")
    if ports:
        sets.append(f"up.ports={json.dumps(list(ports))}")
    if record is not None:
        sets.append(f"recorder.folder={json.dumps(str(record.absolute()))}")
    return tuple(sets)


def _result(report: Report) -> str:
    parts = [f"{report.distance_m:.1f} m", f"{report.waypoints_reached} waypoints", f"{report.collisions} collisions"]
    parts = parts if "plant" in report.services or "thrusters" in report.services else []
    if perception := report.services.get("perception"):
        parts.append(f"perception {perception.rate_hz:.1f} Hz")
    return f"{report.duration_s:.0f} s: {', '.join(parts)}\n"


async def _up(options: argparse.Namespace) -> Outcome:
    plan = await make_plan(_config(options))
    try:
        return await run_plan(plan, options.seconds, Display(sys.stdout))
    except UserError as error:
        raise UserError(f"{error} ({DOCTOR})") from error


async def _prepare(options: argparse.Namespace) -> None:
    plan = await complete_plan(_config(options))
    await asyncio.to_thread(write_plan, plan.config, options.prepare)


def _config(options: argparse.Namespace) -> Config:
    sets = up_sets(
        simulated=config_from(options).bus.graph is Graph.SIMULATION,
        world=options.world,
        camera=options.camera,
        headless=options.headless,
        record=options.record,
        mission=options.mission,
        fence=options.fence,
        only=options.only,
        ports=options.ports,
    )
    return config_from(options, sets)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="paani up", description="Run the whole loop until Ctrl-C.")
    parser.add_argument("--world", metavar="NAME|FILE", help="world or scenario (`paani world list`; default: river)")
    parser.add_argument("--camera", metavar="sim|webcam|PATH", help="where pictures come from (default: sim)")
    parser.add_argument("--for", dest="seconds", type=seconds, metavar="SECONDS", help="stop after this long")
    parser.add_argument(
        "--summary", type=output_file("--summary"), metavar="FILE", help="write the run's figures as JSON"
    )
    parser.add_argument(
        "--prepare",
        type=output_file("--prepare"),
        metavar="FILE",
        help="start nothing: make what the processes need, and write their settings as JSON",
    )
    parser.add_argument(
        "--record", type=output_folder("--record"), metavar="DIR", help="record everything into this folder"
    )
    parser.add_argument(
        "--mission", type=input_file("--mission"), metavar="FILE", help="legs to run, TOML (default: the world's route)"
    )
    parser.add_argument(
        "--fence", type=input_file("--fence"), metavar="FILE", help="areas to keep in and out of, TOML or GeoJSON"
    )
    parser.add_argument(
        "--only",
        choices=(Side.BOARD.value, Side.HOST.value),
        help="the processes of this machine of two, which meet at bus.link",
    )
    parser.add_argument(
        "--with", dest="ports", nargs="+", choices=PORTS, default=(), help="ports to what others use, each a process"
    )
    parser.add_argument("--headless", action="store_true", help="serve no page")
    add_config_arguments(parser)
    return parser
