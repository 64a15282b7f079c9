"""`paani bench faults`: hurts a drive in every way of the catalogue, and measures how soon it stops and comes back."""

from __future__ import annotations

import argparse
import asyncio
import signal
import sys
from collections import Counter
from pathlib import Path

import msgspec

from paani.errors import UserError
from paani.option_numbers import whole_number
from paani.option_paths import output_file
from paani.undecodable import UNREADABLE
from paani.whole_file import write_json
from paani_tools.bench.faults.drives import driving, faults_of, missing
from paani_tools.bench.faults.fault import Drive, Fault
from paani_tools.bench.faults.measure import FaultRun, keeps_bars, measure
from paani_tools.bench.faults.table import fault_table

INTERRUPTED = 130
ALL = [fault for drive in Drive for fault in faults_of(drive)]


def main(argv: list[str]) -> int:
    """Exit codes: 0 every fault did as expected, 1 one did not, 2 user's mistake, 130 interrupted."""
    parser = argparse.ArgumentParser(
        prog="paani bench faults",
        description="Hurt a drive of its own in every way of the catalogue; how soon does it stop, and come back?",
    )
    parser.add_argument("--list", action="store_true", help="name the faults, and what is expected of the boat")
    parser.add_argument("--only", nargs="+", metavar="NAME", help="these faults alone; a word of the name is enough")
    parser.add_argument("--runs", type=whole_number(), default=1, metavar="N", help="of each; default: 1")
    parser.add_argument(
        "--out", type=output_file("--out"), metavar="FILE", help="keep each run there, and go on where it ended"
    )
    options = parser.parse_args(argv)
    chosen = choose(options.only)
    if options.list:
        sys.stdout.write("".join(f"{fault.name}: {fault.expected}\n" for fault in chosen))
        return 0
    runs = read_runs(options.out) if options.out else []
    skipped = {fault.name: missing(fault.drive) for fault in chosen if missing(fault.drive)}
    able = [fault for fault in chosen if fault.name not in skipped]
    interrupted = False
    try:
        asyncio.run(_run(able, runs, options.runs, options.out))
    except (KeyboardInterrupt, asyncio.CancelledError):
        interrupted = True
    sys.stdout.write("\n" + fault_table(chosen, runs, skipped))
    if interrupted:
        return INTERRUPTED
    by_name = {fault.name: fault for fault in chosen}
    return 0 if all(keeps_bars(by_name[run.fault], run) for run in runs if run.fault in by_name) else 1


def choose(names: list[str] | None) -> list[Fault]:
    """The faults whose name has one of these words. Raises UserError for a word that none has."""
    for name in names or []:
        if not any(name in fault.name for fault in ALL):
            raise UserError(f"--only {name}: no such fault (`paani bench faults --list` names them)")
    return [fault for fault in ALL if names is None or any(name in fault.name for name in names)]


def read_runs(file: Path) -> list[FaultRun]:
    """What an earlier call has kept. Raises UserError naming the file."""
    if not file.exists():
        return []
    try:
        return msgspec.json.decode(file.read_bytes(), type=list[FaultRun])
    except UNREADABLE as error:
        raise UserError(f"--out {file}: {error}") from error


async def _run(faults: list[Fault], runs: list[FaultRun], times: int, out: Path | None) -> None:
    """Every drive as often as it takes; each start makes each of its faults once at most."""
    task = asyncio.current_task()
    assert task is not None
    asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, task.cancel)  # so that no drive is left behind
    done = Counter(run.fault for run in runs)
    for _ in range(times):
        for drive in Drive:
            wanted = [fault.name for fault in faults if fault.drive is drive and done[fault.name] < times]
            if not wanted:
                continue
            async with driving(drive) as (loop, bound):
                for name in wanted:
                    run = await measure(bound[name], loop)
                    runs.append(run)
                    done[name] += 1
                    _tell(bound[name], run, done[name], times)
                    if out is not None:
                        await asyncio.to_thread(write_json, out, runs, "--out")


def _tell(fault: Fault, run: FaultRun, number: int, times: int) -> None:
    zero = "went on" if run.zero_s is None else f"zero after {run.zero_s:.2f} s"
    back = "never came back" if run.back_s is None else f"back after {run.back_s:.2f} s"
    words = run.problem or f"{zero}, {back}{', by hand' if run.hands else ''}"
    sys.stdout.write(f"{number}/{times} {fault.name}: {words}{'' if keeps_bars(fault, run) else '  NOT AS EXPECTED'}\n")
    sys.stdout.flush()
