"""The table of detectors by class, source and box height, as aligned text."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import groupby

from paani_models.report.height_scores import HeightRow, Interval

_WIDTHS = (7, 24, 8, 5, 5, 20, 18, 18, 18, 18)


def format_height_table(rows: Sequence[HeightRow]) -> str:
    """One line per detector, class, source and range; values with their 95 % interval over sequences."""
    heads = ("class", "source", "height", "n", "seq", "detector", "AP50", "recall", "precision", "seen")
    lines = [
        "Height of the true box in pixels of the source picture; 95 % intervals over sequences; seen: under a box.",
        _line(heads),
    ]
    for _, group in groupby(rows, lambda row: (row.kind, row.source, row.low_px, row.high_px)):
        for row in group:
            spans = (_format_interval(each) for each in (row.ap50, row.recall, row.precision, row.seen))
            cells = (row.kind, row.source, format_range(row), str(row.n), str(row.sequences), row.detector, *spans)
            lines.append(_line(cells))
    return "\n".join(lines) + "\n"


def _line(cells: Sequence[str]) -> str:
    return " ".join(f"{cell:<{width}}" for cell, width in zip(cells, _WIDTHS, strict=True)).rstrip()


def format_range(row: HeightRow) -> str:
    """`16-32`, `>64`, or `any`."""
    if math.isinf(row.high_px):
        return f">{row.low_px:.0f}" if row.low_px else "any"
    return f"{row.low_px:.0f}-{row.high_px:.0f}"


def _format_interval(each: Interval) -> str:
    if math.isnan(each.value):
        return "-"
    return f"{each.value:.3f}" + ("" if math.isnan(each.low) else f" [{each.low:.2f}, {each.high:.2f}]")
