"""Read training records and fault reports that other commands wrote, and draw their charts."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import msgspec

from paani.errors import UserError
from paani.picture_faults import required_verdict
from paani.statistics.charts import Points, lines
from paani.undecodable import UNDECODABLE, UNREADABLE
from paani_models.catalogue import Figure

RECORDS = ("epochs.jsonl", "log.jsonl")


class FaultCell(msgspec.Struct, frozen=True):
    """One fault at one severity: of n pictures, how many the check refused, and the segmenter's mean IoU."""

    fault: str
    severity: int
    n: int
    rejected: int
    miou: float

    @property
    def verdict(self) -> str:
        """What the image-quality check must do here: "reject", "accept", or "free"."""
        return required_verdict(self.fault, self.miou)


class FaultTotals(msgspec.Struct, frozen=True):
    """Shares over the cells whose verdict is settled, and over clean pictures."""

    false_accept_frac: float
    false_reject_frac: float
    clean_reject_frac: float


class CleanSource(msgspec.Struct, frozen=True):
    """n pictures of a source as they are, and how many of them the image-quality check refused."""

    source: str
    n: int
    rejected: int


class FaultReport(msgspec.Struct, frozen=True):
    """What `paani faults --json` writes, as far as it is used here."""

    cells: tuple[FaultCell, ...]
    clean: tuple[CleanSource, ...] = ()
    totals: FaultTotals | None = None
    without_water: CleanSource | None = None


def read_faults(path: Path) -> FaultReport:
    """Raises UserError naming a file that is missing or malformed."""
    try:
        return msgspec.json.decode(path.read_bytes(), type=FaultReport)
    except UNREADABLE as error:
        raise UserError(f"{path}: {error}") from error


def image_quality_figures(report: FaultReport) -> list[Figure]:
    """The manifest's figures of the image-quality check; n counts pictures."""
    figures = [
        Figure("clean_refused_frac", source.source, round(source.rejected / source.n, 4), source.n)
        for source in report.clean
        if source.n
    ]
    if report.totals is not None:
        spoilt, clean = sum(cell.n for cell in report.cells), sum(source.n for source in report.clean)
        figures += [
            Figure("unfit_accepted_frac", "spoilt", round(report.totals.false_accept_frac, 4), spoilt),
            Figure("fit_refused_frac", "spoilt", round(report.totals.false_reject_frac, 4), spoilt),
            Figure("clean_refused_frac", "all", round(report.totals.clean_reject_frac, 4), clean),
        ]
    dry = report.without_water
    if dry is not None and dry.n:
        figures.append(Figure("unfit_accepted_frac", dry.source, round(1.0 - dry.rejected / dry.n, 4), dry.n))
    return figures


def read_training_record(folder: Path) -> list[dict[str, float]]:
    """Numbers per epoch of a run folder. Raises UserError naming a folder without a record, or a malformed line."""
    path = next((folder / name for name in RECORDS if (folder / name).is_file()), None)
    if path is None:
        raise UserError(f"{folder}: holds neither {' nor '.join(RECORDS)}")
    try:
        lines_of_file = path.read_bytes().splitlines()
    except OSError as error:
        raise UserError(f"{path}: {error.strerror}") from error
    rows = []
    for number, line in enumerate(lines_of_file, 1):
        try:
            rows.append(_flatten_numbers(msgspec.json.decode(line, type=dict[str, object])))
        except UNDECODABLE as error:
            raise UserError(f"{path}:{number}: {error}") from error
    return rows


def _flatten_numbers(row: dict[str, object], prefix: str = "") -> dict[str, float]:
    """Flat: a number in an object is named `object number`."""
    found: dict[str, float] = {}
    for name, value in row.items():
        if isinstance(value, dict):
            found |= _flatten_numbers(value, f"{prefix}{name} ")
        elif isinstance(value, int | float) and not isinstance(value, bool):
            found[f"{prefix}{name}"] = float(value)
    return found


def render_training_charts(rows: Sequence[dict[str, float]]) -> str:
    """Losses on one chart, figures between 0 and 1 on another; of the figures of a class, its AP50."""
    names = [name for name in dict.fromkeys(name for row in rows for name in row) if name != "epoch"]
    series: dict[str, Points] = {
        name: [(row.get("epoch", i + 1), row[name]) for i, row in enumerate(rows) if name in row] for name in names
    }
    losses = {name: points for name, points in series.items() if "loss" in name}
    charted = [name for name in names if name not in losses and (" " not in name or name.endswith(" ap50"))]
    figures = {name: series[name] for name in charted if all(0 <= y <= 1 for _, y in series[name])}
    last = max((x for points in series.values() for x, _ in points), default=1.0)
    charts = []
    if losses:
        top = max(y for points in losses.values() for _, y in points)
        charts.append(lines(losses, "epoch", "loss", (1.0, max(2.0, last)), (0.0, top)))
    if figures:
        charts.append(lines(figures, "epoch", "figure", (1.0, max(2.0, last))))
    return "".join(charts)


def render_fault_charts(report: FaultReport) -> str:
    """Per fault: share refused by the image-quality check, and the segmenter's mean IoU, over severity."""
    charts = []
    for fault in dict.fromkeys(cell.fault for cell in report.cells):
        cells = [cell for cell in report.cells if cell.fault == fault]
        series: dict[str, Points] = {
            "refused": [(cell.severity, cell.rejected / max(1, cell.n)) for cell in cells],
            "mean IoU": [(cell.severity, cell.miou) for cell in cells],
        }
        chart = lines(series, "severity", fault, (1.0, 5.0))
        charts.append(f"<figure>{chart}<figcaption>{fault.replace('_', ' ')}</figcaption></figure>")
    return f'<div class="gallery small">{"".join(charts)}</div>'
