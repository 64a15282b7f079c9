"""What the bench of ports found: figures, bars, and the table."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from statistics import fmean
from typing import NamedTuple

import msgspec

from paani.statistics.order_statistics import median
from paani_tools.up.run_summary import Percentiles, Report, ServiceFigures, percentiles

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


def _decisions_hz(report: Report) -> float:
    return sum(report.decisions.values()) / max(report.duration_s, 1e-9)
