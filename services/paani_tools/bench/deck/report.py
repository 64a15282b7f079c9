"""The figures of `paani bench deck`, and whether they keep the bars. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import linear_regression

import msgspec
import numpy as np

from paani.statistics.order_statistics import nearest_rank
from paani_tools.bench.deck.loads import PageLoad
from paani_tools.up.run_summary import Percentiles

MAX_STOP_P99_MS, MAX_LINK_STOP_P99_MS = 150.0, 300.0  # on this machine; over a link of 50 ms
MAX_BEYOND_P95_MS = 60.0  # from a picture that the simulated camera has drawn to the screen
MAX_LOSS = 0.05  # of the decision rate with ten clients; by so much more may a STOP take among them
RESAMPLED, WITHIN = 2000, 0.95


class Crowd(msgspec.Struct, frozen=True, kw_only=True):
    """A stretch with so many clients, of which one never reads where there are several."""

    clients: int
    cpu_cores: float
    decisions_hz: float


class Ratio(msgspec.Struct, frozen=True):
    """A ratio, and the interval that holds 95 % of those found when the same samples are drawn again."""

    value: float
    low: float
    high: float


class DeckReport(msgspec.Struct, frozen=True, kw_only=True):
    """Times in ms. `camera_hz`: pictures a second that the camera was set to; `received_hz`: that came to a client.

    `received_ms`: from the picture's stamp aboard until a client that only reads has it; `drawn_ms`: until it is on
    the screen, with its evidence; `stage_ms`: by stage, see `picture_path`; `beyond_ms`: from where the simulated
    camera has drawn it; `alone_ms`: the same without overlays, which needs no evidence. `stop_ms`: from the press
    until the thrust adapter says zero, by what stands between; `stop_ratio`: of its medians, with many clients over
    one. `unanswered`: presses and sticks that nothing followed.
    """

    camera_hz: float
    received_hz: float
    loads: tuple[PageLoad, ...]
    received_ms: Percentiles
    drawn_ms: Percentiles
    stage_ms: dict[str, Percentiles]
    beyond_ms: Percentiles
    alone_ms: Percentiles
    crowds: tuple[Crowd, ...]
    stop_ms: dict[str, Percentiles]
    stop_ratio: Ratio | None
    stick_ms: Percentiles
    unanswered: int
    heap_s: float
    heap_slope_mib_h: float | None
    load_average: tuple[float, float]


def heap_slope(samples: Sequence[tuple[float, float]]) -> float | None:
    """MiB an hour through points of time [s] and heap [MiB], by least squares; None for too few."""
    if len(samples) < 3:
        return None
    times_s, heaps_mib = zip(*samples, strict=True)
    return linear_regression(times_s, heaps_mib).slope * 3600.0


def decision_ratio(crowds: Sequence[Crowd]) -> float | None:
    """Decisions a second with many clients over those with one; None where one of them is missing."""
    few = [each.decisions_hz for each in crowds if each.clients == 1]
    many = [each.decisions_hz for each in crowds if each.clients > 1]
    return (sum(many) / len(many)) / (sum(few) / len(few)) if few and many and sum(few) > 0 else None


def ratio_of_medians(numerator: Sequence[float], denominator: Sequence[float]) -> Ratio | None:
    """None where a side has no sample."""
    if not numerator or not denominator:
        return None
    draw = np.random.default_rng(0)
    above, below = (
        np.median(draw.choice(np.asarray(side, np.float64), (RESAMPLED, len(side))), axis=1)
        for side in (numerator, denominator)
    )
    ratios = (above / below).tolist()
    low, high = (nearest_rank(ratios, 50.0 + side * WITHIN / 2) for side in (-100.0, 100.0))
    return Ratio(float(np.median(numerator) / np.median(denominator)), low, high)


def keeps_crowd_bars(report: DeckReport) -> tuple[bool, bool]:
    """Whether many clients slow no decision and no STOP by more than 5 %."""
    decisions, stop = decision_ratio(report.crowds), report.stop_ratio
    return decisions is not None and decisions >= 1.0 - MAX_LOSS, stop is not None and stop.value <= 1.0 + MAX_LOSS


def keeps_picture_bar(figures: Percentiles) -> bool:
    """Whether pictures are on the screen in time."""
    return figures.p95 is not None and figures.p95 <= MAX_BEYOND_P95_MS


def keeps_bars(report: DeckReport) -> bool:
    """Pictures and STOP are in time, STOP over a link too; all was answered; many clients slow nothing by 5 %."""
    in_time = all(
        figures.p99 is not None and figures.p99 <= (MAX_LINK_STOP_P99_MS if "link" in name else MAX_STOP_P99_MS)
        for name, figures in report.stop_ms.items()
    )
    in_time = in_time and keeps_picture_bar(report.beyond_ms) and keeps_picture_bar(report.alone_ms)
    return in_time and report.unanswered == 0 and all(keeps_crowd_bars(report))


def deck_text(report: DeckReport) -> str:
    """The table."""
    loads = sorted(each.load_ms for each in report.loads)
    rows = [
        ("page load until live", f"{loads[0]:.0f} to {loads[-1]:.0f} ms (n = {len(loads)})"),
        ("page load, files and bytes", f"{report.loads[0].files}, {report.loads[0].bytes / 1024:.0f} KiB"),
        ("pictures a second, of the camera and to a client", f"{report.camera_hz:g} and {report.received_hz:.1f}"),
        ("picture to a client", _spread(report.received_ms)),
        ("picture to the screen", _spread(report.drawn_ms)),
        *((f"of which {name}", _spread(figures)) for name, figures in report.stage_ms.items()),
        *(
            (
                f"beyond rendering, {name}",
                f"{_spread(figures)}; bar p95 {MAX_BEYOND_P95_MS:g} ms: {_kept(keeps_picture_bar(figures))}",
            )
            for name, figures in (("with evidence", report.beyond_ms), ("picture alone", report.alone_ms))
        ),
        *((f"STOP to zero thrust, {name}", _spread(figures)) for name, figures in report.stop_ms.items()),
        ("stick to thrust", _spread(report.stick_ms)),
    ]
    for each in report.crowds:
        rows.append((f"dashboard with {each.clients} client{'s' * (each.clients > 1)}",
                     f"{100 * each.cpu_cores:.1f} % of a core, {each.decisions_hz:.2f} decisions/s"))  # fmt: skip
    rows += _crowd_rows(report)
    slope = report.heap_slope_mib_h
    heap = "not measured" if slope is None else f"{slope:+.1f} MiB/h over {report.heap_s:g} s"
    rows.append(("heap of the page", heap))
    lines = ["| what | figure |", "|---|---|", *(f"| {name} | {figure} |" for name, figure in rows)]
    before, after = report.load_average
    return "\n".join(lines) + f"\n\nwithout answer: {report.unanswered}; load {before:.2f} before, {after:.2f} after\n"


def _crowd_rows(report: DeckReport) -> list[tuple[str, str]]:
    """Both ratios of many clients to one, and whether they keep their bars."""
    decisions, stop = decision_ratio(report.crowds), report.stop_ratio
    kept = [_kept(each) for each in keeps_crowd_bars(report)]
    rate = "-" if decisions is None else f"{decisions:.3f}"
    delay = "-" if stop is None else f"{stop.value:.2f} (95 % of draws {stop.low:.2f} to {stop.high:.2f})"
    return [
        ("decisions a second, many clients over one", f"{rate}; bar {1 - MAX_LOSS:g} or more: {kept[0]}"),
        ("STOP p50, many clients over one", f"{delay}; bar {1 + MAX_LOSS:g} or less: {kept[1]}"),
    ]


def _kept(is_kept: bool) -> str:
    return "kept" if is_kept else "NOT KEPT"


def _spread(figures: Percentiles) -> str:
    if figures.p50 is None:
        return "-"
    return f"p50 {figures.p50:.0f}, p95 {figures.p95:.0f}, p99 {figures.p99:.0f} ms (n = {figures.samples})"
