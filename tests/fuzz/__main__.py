"""Hostile payloads for every decoder, from a seed: prints a table by decoder, and keeps what breaks one.

python -m tests.fuzz [--count N] [--seed N] [--only WORD ...] [--keep FOLDER]

Each decoder runs in a process of its own, so that one that dies or hangs is a crash of its row. Ctrl-C ends it with the
rows so far. Exit codes: 0 nothing broke, 1 something did, 130 interrupted.
"""

from __future__ import annotations

import argparse
import hashlib
import multiprocessing
import os
import sys
from multiprocessing.connection import Connection
from pathlib import Path

from paani.clock import stopwatch_ms
from paani_tools.progress import Progress
from tests.fuzz.campaign import TARGETS, Tally, run_target, share_of
from tests.fuzz.target import Target

TOLD_MS = 200.0
HANGS_S = 60.0  # without a payload done
INTERRUPTED = 130
HEAD = (
    "| decoder | given | let in | refused, by the most frequent cause | broke | s | longest [ms] | memory [MiB] |\n"
    "|---|---|---|---|---|---|---|---|\n"
)


def main() -> int:
    """Run and print."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--count", type=int, default=10_000, help="payloads in all, shared out; default: 10,000")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", nargs="+", default=[""], metavar="WORD", help="decoders whose name has such a word")
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="write payloads that break something there")
    options = parser.parse_args()
    chosen = [kind for kind in TARGETS if any(word in kind.name for word in options.only)]
    tallies: list[Tally] = []
    interrupted = False
    sys.stdout.write(HEAD)
    try:
        for kind in chosen:
            tallies.append(_in_own_process(kind, share_of(kind, options.count), options.seed))
            sys.stdout.write(row(tallies[-1]))
            sys.stdout.flush()
    except KeyboardInterrupt:
        interrupted = True
    sys.stdout.write(total_row(tallies))
    for tally in tallies:
        for crash in tally.kept:
            sys.stderr.write(f"{tally.target}: {crash.error}\n")
            if options.keep is not None:
                options.keep.mkdir(parents=True, exist_ok=True)
                (options.keep / hashlib.sha256(crash.data).hexdigest()[:16]).write_bytes(crash.data)
    if interrupted:
        return INTERRUPTED
    return 1 if any(tally.crashes for tally in tallies) else 0


def row(tally: Tally) -> str:
    """Markdown."""
    causes = ", ".join(f"{cause} {number}" for cause, number in list(tally.refused.items())[:3])
    return (
        f"| {tally.target} | {tally.given} | {tally.accepted} | {sum(tally.refused.values())}: {causes} "
        f"| {tally.crashes} | {tally.seconds:.0f} | {tally.longest_ms:.0f} | {tally.peak_mib:.0f} |\n"
    )


def total_row(tallies: list[Tally]) -> str:
    """Sums, and the worst of what has no sum."""
    given, accepted, crashes = (
        sum(getattr(each, name) for each in tallies) for name in ("given", "accepted", "crashes")
    )
    refused = sum(sum(each.refused.values()) for each in tallies)
    seconds = sum(each.seconds for each in tallies)
    longest_ms = max((each.longest_ms for each in tallies), default=0.0)
    peak_mib = max((each.peak_mib for each in tallies), default=0.0)
    return (
        f"| all | {given} | {accepted} | {refused} | {crashes} | {seconds:.0f} | {longest_ms:.0f} | {peak_mib:.0f} |\n"
    )


def _in_own_process(kind: type[Target], count: int, seed: int) -> Tally:
    here, there = multiprocessing.get_context("fork").Pipe()
    process = multiprocessing.get_context("fork").Process(target=_work, args=(there, kind, count, seed))
    process.start()
    there.close()
    given = 0
    try:
        with Progress(f"{kind.name:32.32}") as progress:
            while here.poll(HANGS_S):
                word = here.recv()
                if isinstance(word, Tally):
                    return word
                if isinstance(word, str):
                    raise EOFError(word)
                given = word
                progress.at(given / count, f"{given} of {count}")
        died = f"hangs: no payload done in {HANGS_S:g} s"
    except EOFError as error:
        process.join()
        died = str(error) or f"the process ended with {process.exitcode}"
    finally:
        process.kill()
        process.join()
    sys.stderr.write(f"{kind.name}: {died}, after {given} payloads or more\n")
    return Tally(kind.name, given=given, crashes=1)


def _work(pipe: Connection, kind: type[Target], count: int, seed: int) -> None:
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stderr.fileno())  # libraries write a line for each bad picture
    told_ms = stopwatch_ms()

    def tell(given: int) -> None:
        nonlocal told_ms
        if stopwatch_ms() - told_ms > TOLD_MS:
            told_ms = stopwatch_ms()
            pipe.send(given)

    try:
        pipe.send(run_target(kind, count, seed, tell))
    except KeyboardInterrupt:
        pipe.close()
    except Exception as error:  # noqa: BLE001  # of the harness itself: a decoder's is counted
        pipe.send(f"{type(error).__name__}: {error}")


if __name__ == "__main__":
    sys.exit(main())
