"""Prints the two-host table of deploy/README.md: the river driven by two hosts over links of several kinds.

python -m tests.link.two_host_table [--cuts N] [--seconds S] [--rows TEXT ...]
"""

from __future__ import annotations

import argparse
import os
import statistics
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from paani.statistics.order_statistics import nearest_rank
from tests.link.namespaces import missing
from tests.link.two_hosts import Drive, driving

BACK_S = 60.0


class Row(NamedTuple):
    """A kind of link, and how long it is cut [s]; 0: not at all."""

    name: str
    conditions: dict[str, float]
    cut_s: float = 0.0


PLAIN: dict[str, float] = {"delay_ms": 2.0}
ROWS = (
    Row("2 ms", PLAIN),
    Row("20 ms, 2 % loss", {"delay_ms": 20.0, "jitter_ms": 5.0, "loss": 0.02}),
    Row("4 Mbit/s", {"delay_ms": 2.0, "rate_bps": 4e6}),
    Row("1 Mbit/s", {"delay_ms": 2.0, "rate_bps": 1e6}),
    *(Row(f"2 ms, cut for {cut_s:g} s", PLAIN, cut_s) for cut_s in (0.5, 1.0, 4.0, 20.0)),
    Row("20 ms, 2 % loss, cut for 1 s", {"delay_ms": 20.0, "jitter_ms": 5.0, "loss": 0.02}, 1.0),
)
HEAD = (
    "| link | command age p50 / p99 [ms] | picture age p50 / p99 [ms] | decisions [1/s] | n | link [kbit/s] "
    "| zero thrust: median, max [s] | thrust again: median, max [s] | cuts |\n|---|---|---|---|---|---|---|---|---|\n"
)


def measure(row: Row, cuts: int, seconds: float, seed: int) -> str:
    """One drive over this link, as a row of the table."""
    with tempfile.TemporaryDirectory() as folder, driving(Path(folder), seed=seed) as drive:
        drive.link.set(**row.conditions)
        drive.await_under_way()
        zeros, backs = [], []
        begun_us, before = drive.newest_us(), drive.link.set()
        if not row.cut_s:
            drive.wait(seconds)
        for _ in range(cuts if row.cut_s else 0):
            drive.await_under_way()
            cut_us, back_us = drive.cut(row.cut_s)
            backs.append(drive.await_thrust_after(back_us, BACK_S))
            zeros.append(drive.zero_after_s(cut_us))
        span_s = (drive.newest_us() - begun_us) * 1e-6
        kbps = (drive.link.set().delivered_bytes - before.delivered_bytes) * 8e-3 / span_s
        figures = figures_text(drive, begun_us, span_s if not row.cut_s else 0.0)
    return f"| {row.name} | {figures} | {kbps:.0f} | {spread(zeros)} | {spread(backs)} | {len(zeros)} |\n"


def figures_text(drive: Drive, begun_us: int, span_s: float) -> str:
    """Ages of what was in force while the boat was driven; pictures decided on per second where there was no cut."""
    driven = [each for each in drive.applied if each.at_us >= begun_us and each.cause == "none"]
    ages = (pair([each.command_age_ms for each in driven]), pair([each.picture_age_ms for each in driven]))
    decided = sum(each.at_us >= begun_us for each in drive.decided)
    return " | ".join((*ages, f"{decided / span_s:.1f}" if span_s else "-", str(len(driven))))


def pair(samples: Sequence[float]) -> str:
    ordered = sorted(samples)
    return f"{nearest_rank(ordered, 50):.0f} / {nearest_rank(ordered, 99):.0f}"


def spread(samples: Sequence[float]) -> str:
    return f"{statistics.median(samples):.2f}, {max(samples):.2f}" if samples else "-"


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.link.two_host_table")
    parser.add_argument("--cuts", type=int, default=5, metavar="N", help="cuts of each length; default: 5")
    parser.add_argument("--seconds", type=float, default=40.0, metavar="S", help="of a drive without cuts; default: 40")
    parser.add_argument("--rows", nargs="*", default=[], metavar="TEXT", help="rows whose name begins so; default: all")
    options = parser.parse_args()
    if reason := missing():
        sys.stderr.write(f"{reason}\n")
        return 2
    sys.stdout.write(HEAD)
    for seed, row in enumerate(ROWS):
        if not options.rows or row.name.startswith(tuple(options.rows)):
            sys.stdout.write(measure(row, options.cuts, options.seconds, seed))
            sys.stdout.flush()
    sys.stdout.write(f"\n{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f} at the end\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
