"""Figures of one run, side by side."""

from __future__ import annotations

import msgspec

from paani.statistics.measured import Machine
from paani_tools.up.run_summary import STAGES, Percentiles, Report


class Bench(msgspec.Struct, frozen=True, kw_only=True):
    """`transport_over_inference`: median of everything around inference as a ratio of the median inference."""

    machine: Machine
    run: Report
    transport_over_inference: float | None


def chain_bench(report: Report, machine: Machine) -> Bench:
    """Combine one run with the state of the machine."""
    transport, inference = (report.latency_ms[stage].p50 for stage in ("transport", "inference"))
    ratio = round(transport / inference, 3) if transport is not None and inference else None
    return Bench(machine=machine, run=report, transport_over_inference=ratio)


def chain_text(bench: Bench) -> str:
    """Two tables and three lines."""
    run, machine = bench.run, bench.machine
    lines = [
        f"{run.world}, profile {run.profile}, {run.duration_s:.1f} s; {machine.cores} cores, "
        f"load {machine.load_before:.2f} before and {machine.load_after:.2f} after",
        "",
        f"{'latency [ms]':<18} {'p50':>9} {'p95':>9} {'p99':>9} {'samples':>8}",
        *(_stage(name, run.latency_ms[name]) for name in STAGES),
        "",
        f"{'process':<14} {'rate [Hz]':>9} {'CPU [cores]':>12} {'RSS [MiB]':>10} {'restarts':>9}",
        *(
            f"{name:<14} {s.rate_hz:>9.2f} {s.cpu_cores:>12.3f} {s.rss_mib:>10.1f} {s.restarts:>9}"
            for name, s in run.services.items()
        ),
        f"{'all':<14} {'':>9} {sum(s.cpu_cores for s in run.services.values()):>12.3f}"
        f" {sum(s.rss_mib for s in run.services.values()):>10.1f}",
        "",
        f"perception {run.services['perception'].rate_hz:.2f} Hz; board processes {run.board_rss_mib:.0f} MiB",
        "transport is "
        + ("not measured" if bench.transport_over_inference is None else f"{bench.transport_over_inference:.2f}")
        + " times the inference",
    ]
    return "\n".join(lines) + "\n"


def _stage(name: str, figures: Percentiles) -> str:
    cells = " ".join(f"{'-' if v is None else format(v, '.1f'):>9}" for v in (figures.p50, figures.p95, figures.p99))
    return f"{name:<18} {cells} {figures.samples:>8}"
