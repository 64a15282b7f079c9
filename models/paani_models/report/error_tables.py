"""Requirements, earlier experiments, and the error analysis of each network, as HTML."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from html import escape

import numpy as np
from numpy.typing import NDArray

from paani.statistics.charts import Points, lines
from paani_models.report.box_errors import OUTCOMES, SCORE_STEPS, BoxErrors
from paani_models.report.experiments import Experiment
from paani_models.report.mask_errors import EDGE_DISTANCES_PX, TENTHS, MaskErrors, edge_f1, water_iou
from paani_models.report.requirements import PHOTOGRAPHS, Requirement, RequirementResult
from paani_models.report.tables import TITLES, render_table

POOLED_SOURCES = frozenset({PHOTOGRAPHS, "spoilt", "all"})  # sources that a figure's name omits
_TICKS = 4  # steps of a chart's axis, so that each experiment stands on a whole number


def render_requirements(found: Sequence[RequirementResult], experiments: Sequence[Experiment]) -> str:
    """Render each requirement, its figure and the reason where it is missed; then each figure over the experiments."""
    rows = [
        f'<tr class="{"met" if each.is_met else "missed"}"><th>{escape(_requirement_name(each.requirement))}</th>'
        f"<td>{each.n}</td>"
        f"<td>{_format_bound(each.requirement)}</td><td>{each.value:.{_decimals(each.requirement)}f}</td>"
        f'<td>{"met" if each.is_met else "missed"}</td><td class="text">{escape(each.limit)}</td></tr>'
        for each in found
    ]
    head = '<th>figure</th><th>n</th><th>required</th><th>reached</th><th></th><th class="text">what limits it</th>'
    parts = [
        "<h3>Figures and their requirements</h3>",
        "<p>Real pictures of held-out sequences only. What was tried before stands as it was recorded, where it was "
        "measured on as many pictures or boxes as now.</p>",
        render_table(head, rows),
    ]
    for net in dict.fromkeys(each.requirement.net for each in found):
        now = [each for each in found if each.requirement.net == net]
        mine = [row for row in experiments if row.net == net]
        charts = "".join(f"<figure>{_experiments_chart(each, mine)}</figure>" for each in now)
        parts.append(f'<h3>{net.capitalize()}: what was tried</h3><div class="side">{charts}</div>')
        parts.append(_experiments_table(now, mine))
    return "".join(parts)


def render_mask_errors(limits: Sequence[MaskErrors]) -> str:
    """Render where wrong pixels lie, and the best that the network's cells allow."""
    near = "".join(f"<th>within {reach} px</th>" for reach in EDGE_DISTANCES_PX)
    head = (
        "<th>source</th><th>pictures</th><th>wrong</th><th>taken for water</th><th>water missed</th>"
        f"{near}<th>water IoU</th><th>best of cells</th><th>edge F1</th><th>best of cells</th>"
    )
    rows = []
    for each in limits:
        wrong = max(1, each.wrong)
        shares = (each.false_water.sum() / wrong, each.missed_water.sum() / wrong, *(each.near / wrong))
        figures = (
            water_iou(each.counts),
            water_iou(each.best_counts),
            edge_f1(each.edges),
            edge_f1(each.best_edges),
        )
        cells = "".join(f"<td>{share:.0%}</td>" for share in shares)
        cells += "".join(f"<td>{figure:.3f}</td>" for figure in figures)
        rows.append(
            f"<tr><th>{escape(each.source.name)}</th><td>{each.n}</td>"
            f"<td>{each.wrong / max(1, each.counts.sum()):.2%}</td>{cells}</tr>"
        )
    taken = {each.source.name: each.false_water / each.judged.clip(1) for each in limits}
    missed = {each.source.name: each.missed_water / each.judged.clip(1) for each in limits}
    charts = _height_chart(taken, "something else taken for water") + _height_chart(missed, "water missed")
    return (
        "<h3>Segmenter: where its mistakes lie</h3><p>Shares of the wrong pixels: by kind, and by distance from a "
        "true edge, in pixels of the mask. Best of cells: the truth itself, rounded to one answer per 4x4 pixels of "
        "the input. Undecided bands count as edges, and are split along their middle for edge F1.</p>"
        f'{render_table(head, rows)}<div class="side">{charts}</div>'
    )


def render_box_errors(limits: Sequence[BoxErrors]) -> str:
    """Render recall by height, outcomes and scores of each class."""
    parts = ["<h3>Detector: what limits it</h3><p>Photographs only; heights in pixels of the input, 320x256.</p>"]
    for each in limits:
        rows = [
            f"<tr><th>{_format_height_range(row.low, row.high)}</th><td>{row.n}</td><td>{row.found / row.n:.3f}</td>"
            f"<td>{row.ap50:.3f}</td></tr>"
            for row in each.rows
            if row.n
        ]
        fates = [
            f"<tr><th>{fate}</th><td>{count}</td><td>{count / each.n:.0%}</td></tr>"
            for fate, count in zip(OUTCOMES, each.outcomes, strict=True)
        ]
        parts.append(
            f'<h4>{each.kind}: AP50 {each.ap50:.3f} of {each.n}</h4><div class="side">'
            + render_table("<th>height, px</th><th>n</th><th>recall at 0.40</th><th>AP50</th>", rows)
            + render_table("<th>true objects</th><th>n</th><th>share</th>", fates)
            + _score_chart(each)
            + "</div>"
        )
    return "".join(parts)


def _experiments_chart(now: RequirementResult, experiments: Sequence[Experiment]) -> str:
    requirement = now.requirement
    values = [row.value(requirement.metric, requirement.source, now.n) for row in experiments]
    points: Points = [(number, value) for number, value in enumerate(values, 1) if value is not None]
    other_inference = {number for number, row in enumerate(experiments, 1) if row.inference}
    last = 1.0 + _TICKS * math.ceil(max(1, len(experiments) - 1) / _TICKS)
    heights = [requirement.bound, *(value for _, value in points)]
    ends = (0.0, math.ceil(max(heights) * 50) / 50) if requirement.at_most else (math.floor(min(heights) * 5) / 5, 1.0)
    series: dict[str, Points] = {
        "bar": [(1.0, requirement.bound), (last, requirement.bound)],
        "weights": [point for point in points if point[0] not in other_inference],
        "asked otherwise": [point for point in points if point[0] in other_inference],
    }
    return lines(series, "recipe", _requirement_name(requirement), (1.0, last), ends)


def _experiments_table(now: Sequence[RequirementResult], experiments: Sequence[Experiment]) -> str:
    head = "".join(f"<th>{escape(_requirement_name(each.requirement))}</th>" for each in now)
    rows = []
    for number, row in enumerate(experiments, 1):
        values = [row.value(each.requirement.metric, each.requirement.source, each.n) for each in now]
        cells = "".join(
            "<td></td>" if value is None else f"<td>{value:.{_decimals(each.requirement)}f}</td>"
            for each, value in zip(now, values, strict=True)
        )
        recipe = escape(f"{row.recipe}; {row.inference}" if row.inference else row.recipe)
        rows.append(f'<tr><th>{number}</th><td class="text">{recipe} <code>{row.sha256[:8]}</code></td>{cells}</tr>')
    return render_table(f'<th></th><th class="text">recipe</th>{head}', rows)


def _height_chart(shares: Mapping[str, NDArray[np.float64]], title: str) -> str:
    largest = max((float(share.max()) for share in shares.values()), default=0.0)
    top = float(_TICKS * max(1, math.ceil(100 * largest / _TICKS)))
    series: dict[str, Points] = {
        name: [((tenth + 0.5) / TENTHS, 100 * float(value)) for tenth, value in enumerate(share)]
        for name, share in shares.items()
    }
    y_label = f"{title}, % of the pixels there"
    return lines(series, "height in the picture, 0 at the top", y_label, (0.0, 1.0), (0.0, top))


def _score_chart(limits: BoxErrors) -> str:
    first = int(1 + 0.1 // SCORE_STEPS[1])  # below a score of 0.1 wrong boxes outnumber all others by far
    middles = (SCORE_STEPS[:-1] + SCORE_STEPS[1:])[first:] / 2
    counts = {"right": limits.right[first:], "wrong": limits.wrong[first:]}
    series: dict[str, Points] = {
        name: [(float(x), float(y)) for x, y in zip(middles, ys, strict=True)] for name, ys in counts.items()
    }
    top = float(max(1, *(ys.max() for ys in counts.values())))
    return lines(series, "score", f"{limits.kind} boxes", (0.0, 1.0), (0.0, top))


def _requirement_name(requirement: Requirement) -> str:
    metric = TITLES.get(requirement.metric) or requirement.metric.replace("_ap50", " AP50")
    return metric if requirement.source in POOLED_SOURCES else f"{metric}, {requirement.source}"


def _format_bound(requirement: Requirement) -> str:
    return f"{'at most ' if requirement.at_most else ''}{requirement.bound:.{_decimals(requirement)}f}"


def _decimals(requirement: Requirement) -> int:
    """Decimals shown: more for shares near 0 than for figures near 1."""
    return 4 if requirement.at_most else 3


def _format_height_range(low: float, high: float) -> str:
    return f"{low:g} to {high:g}" if math.isfinite(high) else f"{low:g} and more"
