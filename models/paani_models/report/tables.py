"""Estimates and counts as HTML tables."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from paani.statistics.charts import bar
from paani_models.report.estimates import Confusion, Estimate
from paani_models.report.evidence import Finding

TITLES = {
    "iou_water": "water IoU",
    "iou_obstacle": "obstacle IoU",
    "iou_sky": "sky IoU",
    "miou": "mean IoU",
    "edge_f1": "edge F1",
    "ap50": "AP50",
    "ap50_95": "AP50:95",
    "recall_at_0.40": "recall",
    "recall_16px_at_0.40": "recall, near",
    "precision_at_0.40": "precision",
    "unfit_accepted_frac": "unfit, let through",
    "fit_refused_frac": "fit, refused",
    "clean_refused_frac": "as it is, refused",
}
MASK_METRICS = ("iou_water", "iou_obstacle", "iou_sky", "miou", "edge_f1")
BOX_METRICS = ("ap50", "ap50_95", "recall_at_0.40", "recall_16px_at_0.40", "precision_at_0.40")


def render_mask_table(estimates: Sequence[Estimate]) -> str:
    """Sources down, metrics across, each with its interval."""
    head = "".join(f"<th>{TITLES[metric]}</th>" for metric in MASK_METRICS)
    rows = []
    for name in _list_sources(estimates):
        mine = {e.metric: e for e in estimates if e.source == name and not e.sequence}
        first = next(iter(mine.values()))
        cells = "".join(f"<td>{_render_cell(mine.get(metric))}</td>" for metric in MASK_METRICS)
        rows.append(f"<tr><th>{escape(name)}</th><td>{first.n}</td><td>{first.sequences}</td>{cells}</tr>")
    return render_table(f"<th>source</th><th>pictures</th><th>sequences</th>{head}", rows)


def render_box_table(estimates: Sequence[Estimate], kind: str) -> str:
    """Of one class: sources down, metrics across."""
    mine = [e for e in estimates if e.metric.startswith(f"{kind}_") and not e.sequence]
    head = "".join(f"<th>{TITLES[metric]}</th>" for metric in BOX_METRICS)
    rows = []
    for name in _list_sources(mine):
        found = {e.metric.removeprefix(f"{kind}_"): e for e in mine if e.source == name}
        first = next(iter(found.values()))
        cells = "".join(f"<td>{_render_cell(found.get(metric))}</td>" for metric in BOX_METRICS)
        total = ' class="total"' if name == "all" else ""
        rows.append(f"<tr{total}><th>{escape(name)}</th><td>{first.n}</td><td>{first.sequences}</td>{cells}</tr>")
    return render_table(f"<th>source</th><th>boxes</th><th>sequences</th>{head}", rows)


def render_sequence_table(estimates: Sequence[Estimate], metric: str) -> str:
    """One metric of every sequence, the worst first."""
    mine = sorted((e for e in estimates if e.metric == metric and e.sequence), key=lambda e: (e.value, e.source))
    rows = [
        f"<tr><th>{escape(e.source)}</th><td>{escape(e.sequence)}</td><td>{e.n}</td><td>{_render_cell(e)}</td></tr>"
        for e in mine
    ]
    return render_table("<th>source</th><th>sequence</th><th>n</th><th>value</th>", rows)


def render_rate_table(estimates: Sequence[Estimate]) -> str:
    """One rate per source with its interval."""
    rows = [
        f"<tr><th>{escape(e.source)}</th><td>{e.n}</td><td>{e.sequences}</td><td>{_render_cell(e)}</td></tr>"
        for e in estimates
        if not e.sequence
    ]
    return render_table("<th>source</th><th>pictures</th><th>sequences</th><th>per picture</th>", rows)


def render_confusion_table(confusion: Confusion) -> str:
    """Shares of each row, the count in the tooltip; rows are the truth."""
    head = "".join(f"<th>{escape(name)}</th>" for name in confusion.classes)
    rows = []
    for name, counts in zip(confusion.classes, confusion.counts, strict=True):
        total = sum(counts)
        cells = "".join(
            f'<td class="heat" style="--share:{count / total:.3f}" title="{count:,}">{count / total:.1%}</td>'
            if total
            else "<td></td>"
            for count in counts
        )
        rows.append(f"<tr><th>{escape(name)}</th>{cells}<td>{total:,}</td></tr>")
    return render_table(f"<th>{escape(confusion.source)}: truth \\ found</th>{head}<th>n</th>", rows)


def render_findings_table(findings: Sequence[Finding]) -> str:
    """One row per finding."""
    rows = [
        f"<tr><th>{escape(f.metric)}</th><td>{escape(f.source)}</td><td>{f.value:g}</td>"
        f"<td>{f.n} {escape(f.of)}</td></tr>"
        for f in findings
    ]
    return render_table("<th>metric</th><th>source</th><th>value</th><th>n</th>", rows)


def _render_cell(estimate: Estimate | None) -> str:
    if estimate is None:
        return ""
    ends = (
        f'<span class="ends">{estimate.low:.3f} to {estimate.high:.3f}</span>'
        if estimate.low is not None and estimate.high is not None
        else ""
    )
    return f"{estimate.value:.3f}{bar(estimate.value, estimate.low, estimate.high)}{ends}"


def _list_sources(estimates: Sequence[Estimate]) -> list[str]:
    names = list(dict.fromkeys(e.source for e in estimates if not e.sequence))
    return [name for name in names if name != "all"] + (["all"] if "all" in names else [])


def render_table(head: str, rows: Sequence[str]) -> str:
    """Head cells and rows, each HTML text; scrolls sideways where it is too wide."""
    return f'<div class="wide"><table><thead><tr>{head}</tr></thead><tbody>{"".join(rows)}</tbody></table></div>'
