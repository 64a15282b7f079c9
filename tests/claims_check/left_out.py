"""Which statements of the paper a run of the tests left unproved, because a test that proves them did not run."""

from __future__ import annotations

from collections.abc import Mapping

from tests.claims_check.table import Row

EXTRA = "paani[train]"  # named by the tests that skip without it
COMMAND = "make test EXTRAS=host,dev,train"


def left_out_text(rows: Mapping[str, Row], ran: set[str], skipped: Mapping[str, str]) -> str:
    """One line that names these rows and the command that runs what they lack; empty where none is left out.

    ran: tests that passed or failed, as `file::function`. skipped: the reason of each that skipped, or in part, by
    `file::function`, or by `file` where the whole file did.
    """
    lacking: dict[str, list[str]] = {}
    for name, row in rows.items():
        for test in row.test:
            reason = skipped.get(test) or skipped.get(test.partition("::")[0])
            if reason is not None or test not in ran:
                lacking.setdefault(name, []).append(reason or "not selected")
    if not lacking:
        return ""
    by_extra = [name for name, reasons in lacking.items() if any(EXTRA in reason for reason in reasons)]
    others = [name for name in lacking if name not in by_extra]
    parts = [f"{' '.join(by_extra)} (`{COMMAND}` runs them)"] if by_extra else []
    if others:
        reasons = sorted({reason for name in others for reason in lacking[name]})
        parts.append(f"{' '.join(others)} ({'; '.join(reasons)})")
    proved = sum(bool(row.test) for row in rows.values())
    return f"Left out: {len(lacking)} of {proved} statements whose tests did not all run: {', '.join(parts)}"
