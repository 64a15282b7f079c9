"""One table of figures, and where others put theirs.

A package adds a table to `paani bench judgement` with an entry point in the group `paani.benches`: a function without
arguments that gives a `FigureTable`. It adds a benchmark of its own with one in the group `paani.bench_commands`: a
function of the words that follow the benchmark's name, `def main(argv: list[str]) -> int`.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import EntryPoint, entry_points

import msgspec

Cell = str | int | float | None


class FigureTable(msgspec.Struct, frozen=True, kw_only=True):
    """`rows` have as many cells as there are `columns`; None where nothing was measured. `note`: how to read it."""

    name: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    note: str = ""


def installed_tables() -> dict[str, Callable[[], FigureTable]]:
    """What is installed, by name."""
    return {point.name: point.load() for point in sorted(entry_points(group="paani.benches"), key=lambda p: p.name)}


def installed_commands() -> dict[str, EntryPoint]:
    """Benchmarks of other packages, not loaded yet, by name."""
    return {point.name: point for point in entry_points(group="paani.bench_commands")}


def table_text(part: FigureTable) -> str:
    """Numbers to the right, words to the left."""
    cells = [tuple(map(_cell, row)) for row in part.rows]
    widths = [max(map(len, column)) for column in zip(part.columns, *cells, strict=True)]
    numeric = [any(isinstance(row[i], int | float) for row in part.rows) for i in range(len(part.columns))]
    lines = [
        "  ".join(
            text.rjust(width) if right else text.ljust(width)
            for text, width, right in zip(row, widths, numeric, strict=True)
        ).rstrip()
        for row in (part.columns, *cells)
    ]
    return "\n".join([part.name, *lines, *([part.note] if part.note else [])]) + "\n"


def _cell(value: Cell) -> str:
    if value is None:
        return "-"
    return f"{value:.3f}" if isinstance(value, float) else str(value)
