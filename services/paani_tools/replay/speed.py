"""How fast recorded drives are decided again, for `paani bench judgement --drive LOG`."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from paani.clock import process_cpu_s
from paani.logs.reader import open_log
from paani.statistics.figure_table import FigureTable
from paani_tools.replay.compatibility import provenance_of
from paani_tools.replay.verify import check_log


def measure_replay(drives: Iterable[Path]) -> FigureTable:
    """Check each recording once. Raises UserError for one that cannot be read."""
    rows = []
    for path in drives:
        log = open_log(path)
        config = provenance_of(log, force=True).config
        before_s = process_cpu_s()
        report = check_log(log, config)
        cpu_s = process_cpu_s() - before_s
        rows.append(
            (
                path.name,
                report.log_s,
                report.took_s,
                round(report.log_s / report.took_s) if report.took_s else None,
                round(report.log_s / cpu_s) if cpu_s else None,
                report.decisions,
                report.differ,
            )
        )
    return FigureTable(
        name="replay --check",
        columns=("drive", "log [s]", "took [s]", "x real time", "x real time, own CPU", "decisions", "differ"),
        rows=tuple(rows),
        note="on a busy machine, time of the process's own CPU says more than time on the wall",
    )
