"""`paani bench board`: the paper's board protocol (U10) as a table beside the paper's column, its raw polls kept."""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import datetime
import os
import signal
import sys
from collections.abc import Awaitable, Callable
from pathlib import Path
from urllib.parse import urlsplit

import msgspec
from msgspec.structs import replace

from paani.cli import add_config_arguments, config_from
from paani.clock import Clock, WallClock
from paani.config import Config
from paani.errors import UserError
from paani.keys import Graph
from paani.option_numbers import whole_number
from paani.option_paths import input_folder, output_folder
from paani.page_address import page_origin
from paani.statistics.figure_table import table_text
from paani.whole_file import write_whole
from paani_tools.bench.board.figures import board_figures, networks_of
from paani_tools.bench.board.host_counters import HostCounters
from paani_tools.bench.board.machine import identify_machine
from paani_tools.bench.board.poll import Fetch, Poll, await_first_result, http_fetch, poll_board
from paani_tools.bench.board.table import BoardRun, board_table
from paani_tools.progress import Progress
from paani_tools.up.command import up_sets
from paani_tools.up.lifecycle import run_plan
from paani_tools.up.plan import Plan, make_plan
from paani_tools.up.terminal import Display

POLLS, MAX_POLLS = 300, 100_000  # U10
FIGURES_FILE = "board.json"
SIMULATION_SERVICES = frozenset({"plant", "eye", "localization"})  # A3: on another host than the board


class BoardRecord(msgspec.Struct, frozen=True, kw_only=True):
    """What is kept: the run's figures, and every poll as it was answered."""

    run: BoardRun
    polls: tuple[Poll, ...]


def main(argv: list[str]) -> int:
    """Exit codes: 0 every poll was made, 1 it was interrupted or the loop failed, 2 user's mistake."""
    options = _parser().parse_args(argv)
    if options.attach is not None and (options.camera is not None or options.world is not None):
        raise UserError("--attach: the running loop has its camera and world already")
    if options.attach is None and options.cgroup_of is not None:
        raise UserError("--cgroup-of: only with --attach; a loop started here is in this process's control group")
    clock = WallClock()
    config = config_from(options, up_sets(simulated=False, world=options.world, camera=options.camera, headless=False))
    machine, counters = identify_machine(), HostCounters(pid=options.cgroup_of or "self")
    folder = _free_folder(options.out, clock)
    config = replace(config, recorder=replace(config.recorder, folder=str(folder.absolute())))
    polls: list[Poll] = []
    if options.attach is not None:
        profile, condition, failure = asyncio.run(_attach(options, counters, clock, polls))
    else:
        profile = config.profile
        condition, failure = asyncio.run(_start(options, config, folder, counters, clock, polls))
    run = BoardRun(
        machine=replace(machine, load_after=round(os.getloadavg()[0], 2)),
        profile=profile,
        conditions=(condition, f"Networks: {networks_of(polls)}."),
        memory_group=counters.memory_group,
        figures=board_figures(polls, options.polls),
        absent=counters.absent,
    )
    if polls:
        _keep(folder, BoardRecord(run=run, polls=tuple(polls)))
        sys.stdout.write("\n" + table_text(board_table(run)) + f"kept in {folder}\n")
    if failure or len(polls) < options.polls:
        sys.stderr.write(f"paani: {failure or 'interrupted'} after {len(polls)} of {options.polls} polls\n")
        return 1
    return 0


async def _start(
    options: argparse.Namespace, config: Config, folder: Path, counters: HostCounters, clock: Clock, polls: list[Poll]
) -> tuple[str, str]:
    """Run the loop on this machine, unarmed, and poll it. Returns what ran, and why it failed ("": it did not)."""
    plan = await make_plan(config)
    drawn = config.camera.source == "sim"
    if not drawn and config.bus.graph is Graph.SIMULATION:
        plan = Plan(tuple(name for name in plan.services if name not in SIMULATION_SERVICES), plan.config)
    failures: list[str] = []

    async def poll() -> None:
        failures.append(await _poll(http_fetch(page_origin(config)), options, counters, clock, polls))

    outcome = await run_plan(plan, None, Display(sys.stderr), poll)
    condition = f"Pictures from {config.camera.source}; everything is recorded beside {FIGURES_FILE}."
    if drawn:
        condition += " The simulator runs on this machine too, and its CPU and memory are in the figures."
    return condition, outcome.failure or next(iter(failures), "")


async def _attach(
    options: argparse.Namespace, counters: HostCounters, clock: Clock, polls: list[Poll]
) -> tuple[str, str, str]:
    """Poll a loop that runs already. Returns its profile, what ran, and why it failed."""
    fetch, failures = http_fetch(options.attach), list[str]()

    async def poll() -> None:
        failures.append(await _poll(fetch, options, counters, clock, polls))

    await _until_signal(poll)
    profile = next((poll.status.profile for poll in polls if poll.status is not None), "unknown")
    condition = f"Attached to {options.attach}; that loop's own recorder keeps its messages."
    return profile, condition, next(iter(failures), "")


async def _poll(
    fetch: Fetch, options: argparse.Namespace, counters: HostCounters, clock: Clock, polls: list[Poll]
) -> str:
    """All polls, with a bar. Returns why there was nothing to poll ("": there was)."""
    if failure := await await_first_result(fetch, clock):
        return failure
    with Progress("polling") as bar:
        await poll_board(
            fetch, counters, clock, options.polls, polls,
            lambda made: bar.at(made / options.polls, f"{made} of {options.polls}"),
        )  # fmt: skip
    return ""


async def _until_signal(work: Callable[[], Awaitable[None]]) -> None:
    """Await the work, or give it up at a signal."""
    task, loop = asyncio.ensure_future(work()), asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, task.cancel)
    with contextlib.suppress(asyncio.CancelledError):
        await task


def _free_folder(out: Path | None, clock: Clock) -> Path:
    """Where to keep this run. Raises UserError for a folder that already keeps one."""
    moment = datetime.datetime.fromtimestamp(clock.now_us() * 1e-6, tz=datetime.UTC)
    folder = out or output_folder("--out")(f"runs/board-{moment:%Y%m%dT%H%M%SZ}")
    if folder.is_dir() and any(folder.iterdir()):
        raise UserError(f"--out {folder}: not empty; every run is kept in a folder of its own")
    return folder


def _keep(folder: Path, record: BoardRecord) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"--out {folder}: {error.strerror}") from error
    write_whole(folder / FIGURES_FILE, msgspec.json.encode(record) + b"\n", "--out")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="paani bench board",
        description="Poll the board's loop once a second and put its figures beside the paper's (--profile paper).",
    )
    parser.add_argument(
        "--polls", type=whole_number(1, MAX_POLLS), default=POLLS, metavar="N", help=f"default: {POLLS}, five minutes"
    )
    parser.add_argument("--camera", metavar="sim|webcam|PATH", help="where pictures come from (default: sim)")
    parser.add_argument("--world", metavar="NAME|FILE", help="world or scenario of `sim` (default: river)")
    parser.add_argument("--attach", type=_url, metavar="URL", help="poll a running loop, such as http://127.0.0.1:8043")
    parser.add_argument("--cgroup-of", type=_pid, metavar="PID", help="with --attach: a process of that loop")
    parser.add_argument(
        "--out", type=output_folder("--out"), metavar="DIR", help="keep everything there (default: runs/board-<UTC>)"
    )
    add_config_arguments(parser)
    return parser


def _url(text: str) -> str:
    with contextlib.suppress(ValueError):  # of a port beyond 65535
        parts = urlsplit(text)
        if parts.scheme == "http" and parts.hostname and parts.port != 0 and not (parts.path.strip("/") or parts.query):
            return text.rstrip("/")
    raise argparse.ArgumentTypeError(f"'{text}': expected an address such as http://127.0.0.1:8043")


def _pid(text: str) -> str:
    number = whole_number()(text)
    input_folder("--cgroup-of")(f"/proc/{number}")
    return str(number)
