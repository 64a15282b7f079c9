"""The fault table."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from paani.statistics.order_statistics import median
from paani_tools.bench.faults.fault import Expected, Fault
from paani_tools.bench.faults.measure import FaultRun, keeps_bars

HEAD = (
    "| fault | expected | n | limit [s] | zero thrust [s]: median, max | thrust again [s]: median, max "
    "| longest without a decision [s] | hands | kept |\n|---|---|---|---|---|---|---|---|---|\n"
)


def fault_table(faults: Iterable[Fault], runs: Sequence[FaultRun], skipped: Mapping[str, str]) -> str:
    """Markdown; a line for each fault, and what was not measured, and why."""
    lines = []
    for fault in faults:
        found = [run for run in runs if run.fault == fault.name]
        if not found:
            continue
        kept = sum(keeps_bars(fault, run) for run in found)
        lines.append(
            f"| {fault.name} | {fault.expected} | {len(found)} | {_limit(fault)} "
            f"| {_span([run.zero_s for run in found])} | {_span([run.back_s for run in found])} "
            f"| {max(run.blind_s for run in found):.1f} | {sum(run.hands for run in found)} | {kept} |"
        )
    notes = [f"{run.fault}: {run.problem}" for run in runs if run.problem]
    notes += [f"{run.fault}: armed again by itself" for run in runs if run.rearmed]
    notes += [f"not measured: {name}: {reason}" for name, reason in skipped.items()]
    return HEAD + "\n".join(lines) + "\n" + "".join(f"\n{note}" for note in notes) + ("\n" if notes else "")


def _limit(fault: Fault) -> str:
    return "-" if fault.expected in {Expected.GOES_ON, Expected.MAY_STAND} else f"{fault.zero_s:g}"


def _span(values: Sequence[float | None]) -> str:
    """Median and maximum of those that there are; a dash where there is none."""
    known = [value for value in values if value is not None]
    return f"{median(known):.2f}, {max(known):.2f}" if known else "-"
