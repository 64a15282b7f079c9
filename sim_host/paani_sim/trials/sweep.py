"""What a sweep shows: how many drives end well and how many touch something, by the value of one condition. Pure."""

from __future__ import annotations

from collections.abc import Mapping

from paani.statistics.charts import Points, drawing, element, lines
from paani.statistics.figure_table import Cell, FigureTable
from paani_sim.trials.conditions import parse_setting
from paani_sim.trials.intervals import wilson_interval
from paani_sim.trials.policies import Policy
from paani_sim.trials.result import TrialResult
from paani_sim.trials.seed_parts import part_of_parts
from paani_sim.trials.trial_cases import TrialCase

COMPLETED_BAR, TOUCHED_BAR = 0.95, 0.01  # shares of drives below and above which a value is outside the envelope
CHART_WIDTH_PX, CHART_HEIGHT_PX = 440, 270
STYLE = ".grid{stroke:#dde4e8}text{font:11px sans-serif}.tick,.label{fill:#1c2b33}"  # a name has its curve's colour

Drives = Mapping[TrialCase, TrialResult]


def tabulate_sweep(results: Drives) -> FigureTable:
    """A row for each policy and value."""
    rows: list[tuple[Cell, ...]] = []
    for policy, value, drives in _group(results):
        completed, touched = sum(each.completed for each in drives), sum(each.collisions > 0 for each in drives)
        rows.append(
            (policy.value, value, len(drives), *_percent(completed, len(drives)), *_percent(touched, len(drives)))
        )
    part = part_of_parts({each.part for each in results.values()})
    worlds, seeds = sorted({case.world for case in results}), {case.seed for case in results}
    return FigureTable(
        name=f"{_condition(results)}, {part.value} seeds",
        columns=("policy", _condition(results), "drives", "completed %", "low", "high", "touched %", "low", "high"),
        rows=tuple(rows),
        note=f"{', '.join(worlds)}, {len(seeds)} seeds in each; low and high: 95 % Wilson interval",
    )


def plot_sweep(results: Drives) -> str:
    """Both shares with their intervals over the values, as SVG; the bars of the envelope beside them."""
    values = sorted({value for _, value, _ in _group(results)})
    span = (values[0], values[-1] if len(values) > 1 else values[0] + 1.0)
    completed: dict[str, Points] = {f"{COMPLETED_BAR:.0%}": [(at, COMPLETED_BAR) for at in span]}
    touched: dict[str, Points] = {f"{TOUCHED_BAR:.0%}": [(at, TOUCHED_BAR) for at in span]}
    for policy in dict.fromkeys(policy for policy, _, _ in _group(results)):
        groups = [(value, drives) for each, value, drives in _group(results) if each is policy]
        for shares, counts in (
            (completed, [(value, sum(each.completed for each in drives), len(drives)) for value, drives in groups]),
            (touched, [(value, sum(each.collisions > 0 for each in drives), len(drives)) for value, drives in groups]),
        ):
            shares[policy.value] = [(value, count / of) for value, count, of in counts]
            for number, name in enumerate(("low", "high")):
                shares[f"{policy.value} {name}"] = [
                    (value, wilson_interval(count, of)[number]) for value, count, of in counts
                ]
    condition = _condition(results)
    charts = [lines(completed, condition, "completed", span), lines(touched, condition, "touched something", span)]
    width_px = CHART_WIDTH_PX * len(charts)
    parts = [
        element("style", STYLE),
        element("rect", width=width_px, height=CHART_HEIGHT_PX, fill="#ffffff"),
        *(f'<g transform="translate({CHART_WIDTH_PX * k} 0)">{chart}</g>' for k, chart in enumerate(charts)),
    ]
    title = f"Drives completed, and with a contact, by {condition}"
    size = {"width": width_px, "height": CHART_HEIGHT_PX}
    return drawing(width_px, CHART_HEIGHT_PX, title, parts, xmlns="http://www.w3.org/2000/svg", **size) + "\n"


def _group(results: Drives) -> list[tuple[Policy, float, list[TrialResult]]]:
    """The drives of each policy at each value, in that order."""
    groups: dict[tuple[Policy, float], list[TrialResult]] = {}
    for case, result in results.items():
        groups.setdefault((case.policy, parse_setting(case.swept)[1]), []).append(result)
    order = list(Policy)
    return [(*key, groups[key]) for key in sorted(groups, key=lambda each: (order.index(each[0]), each[1]))]


def _condition(results: Drives) -> str:
    return parse_setting(next(iter(results)).swept)[0]


def _percent(count: int, of: int) -> tuple[float, float, float]:
    low, high = wilson_interval(count, of)
    return 100.0 * count / of, 100.0 * low, 100.0 * high
