"""The figures of a suite as lines of text. Pure."""

from __future__ import annotations

from collections.abc import Sequence

from paani_sim.trials.imazu_summary import format_imazu
from paani_sim.trials.intervals import Share
from paani_sim.trials.suite_summary import PolicyFigures, SeedsDriven, Summary

_Column = tuple[str, int]
_DRIVE_COLUMNS: tuple[_Column, ...] = (
    ("policy", 12), ("profile", 8), ("drives", 6), ("completed [95 %]", 22), ("no contact [95 %]", 22),
    ("contacts", 8), ("visible", 7), ("bank", 5), ("near", 5), ("least", 6), ("off rms", 8), ("m/s", 5),
    ("turns/min", 9),
)  # fmt: skip
_EXPOSURE_COLUMNS: tuple[_Column, ...] = (
    ("policy", 12), ("km", 7), ("contacts/km [95 %]", 20), ("near misses/km [95 %]", 21), ("close/km", 8),
    ("met", 5), ("touched [95 %]", 22), ("near [95 %]", 22), ("people", 6), ("at 1.5 m [95 %]", 22),
)  # fmt: skip


def format_summary(summary: Summary) -> str:
    """The part and number of seeds; of each policy a line by drive, and one by km and encounter; one per fault."""
    lines = [describe_seeds(summary.seeds), _row(_DRIVE_COLUMNS, [name for name, _ in _DRIVE_COLUMNS])]
    lines += [_row(_DRIVE_COLUMNS, _drive_cells(name, p)) for name, p in summary.policies.items()]
    lines += ["", _row(_EXPOSURE_COLUMNS, [name for name, _ in _EXPOSURE_COLUMNS])]
    lines += [_row(_EXPOSURE_COLUMNS, _exposure_cells(name, p)) for name, p in summary.policies.items()]
    if summary.faults:
        lines += [
            "",
            f"{'fault':16} {'drives':>6} {'completed':>9} {'contacts':>8} {'in time':>9} {'fans off [s]':>12}",
        ]
        for name, f in summary.faults.items():
            judged = f"{f.in_time}/{f.judged}" if f.judged else "-"
            worst = "-" if f.worst_zero_thrust_s is None else f"{f.worst_zero_thrust_s:.2f}"
            lines.append(f"{name:16} {f.trials:6} {f.completed:9} {f.collisions:8} {judged:>9} {worst:>12}")
    lines += format_imazu(summary.imazu)
    return "\n".join(lines) + "\n"


def describe_seeds(seeds: SeedsDriven) -> str:
    """Part and number of seeds, and what a ledger says of them, in one line."""
    words = [f"{seeds.part.value} seeds: {seeds.seeds}; drives: {seeds.drives}"]
    if seeds.asked != seeds.drives:
        words.append(f"{seeds.asked - seeds.drives} without a result")
    if seeds.commit:
        words.append(f"commit {seeds.commit[:12]}")
    if seeds.ledger is not None:
        ledger = seeds.ledger
        words.append(f"ledger: {ledger.drawn} drawn, {ledger.with_result} with a result, {ledger.commits} commits")
        if ledger.differing:
            words.append(f"{ledger.differing} went otherwise when driven again")
    return "; ".join(words)


def _drive_cells(name: str, p: PolicyFigures) -> list[str]:
    return [
        name, p.profile, str(p.trials), _format_share(p.completed_share), _format_share(p.untouched_share),
        str(p.collisions), str(p.collisions_visible), str(p.collisions_bank), str(p.near_misses),
        f"{p.min_clearance_m:.2f}", f"{p.off_route_rms_m:.2f}", f"{p.mean_speed_mps:.2f}", f"{p.changes_per_min:.2f}",
    ]  # fmt: skip


def _exposure_cells(name: str, p: PolicyFigures) -> list[str]:
    return [
        name, f"{p.distance_m * 1e-3:.3f}", _format_rate(p.contacts_per_km, p.contacts_per_km_interval),
        _format_rate(p.near_misses_per_km, p.near_misses_per_km_interval), f"{p.close_per_km:.2f}", str(p.encountered),
        _format_share(p.touched_encounter_share), _format_share(p.near_encounter_share), str(p.encountered_people),
        _format_share(p.person_clear_share),
    ]  # fmt: skip


def _row(columns: Sequence[_Column], cells: Sequence[str]) -> str:
    padded = [f"{cell:>{width}}" for (_, width), cell in zip(columns, cells, strict=True)]
    return " ".join([f"{cells[0]:{columns[0][1]}}", *padded[1:]])


def _format_share(s: Share) -> str:
    return f"{100 * s.share:5.1f} % [{100 * s.low:4.1f}, {100 * s.high:5.1f}]"


def _format_rate(rate: float, interval: tuple[float, float]) -> str:
    return f"{rate:.2f} [{interval[0]:.2f}, {interval[1]:.2f}]"
