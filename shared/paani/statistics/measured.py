"""Parts measured one after the other, each printed as it is done."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable

import msgspec

from paani.statistics.figure_table import FigureTable, table_text


class Machine(msgspec.Struct, frozen=True, kw_only=True):
    """What the run shared the machine with: load is the one-minute average of runnable processes."""

    cores: int
    load_before: float
    load_after: float


class Report(msgspec.Struct, frozen=True, kw_only=True):
    """What `--json` writes."""

    machine: Machine
    parts: tuple[FigureTable, ...]


def measure_tables(parts: Iterable[Callable[[], FigureTable]]) -> Report:
    """Print each table as it is done, then what the run shared the machine with."""
    cores, load_before, done = os.cpu_count() or 1, os.getloadavg()[0], []
    for part in parts:
        done.append(part())
        sys.stdout.write("\n" + table_text(done[-1]))
        sys.stdout.flush()
    machine = Machine(cores=cores, load_before=round(load_before, 2), load_after=round(os.getloadavg()[0], 2))
    sys.stdout.write(
        f"\n{machine.cores} cores, load {machine.load_before:.2f} before and {machine.load_after:.2f} after\n"
    )
    return Report(machine=machine, parts=tuple(done))
