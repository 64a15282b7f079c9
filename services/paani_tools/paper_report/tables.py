"""The tables: the paper's column, ours, n, and why they differ or cannot be compared. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import fmean

import numpy as np
from msgspec.structs import replace

from paani import messages as m
from paani.config import Config
from paani.statistics.figure_table import FigureTable
from paani_models.catalogue import Figure, Model
from paani_sim.worlds import load_world
from paani_sim.worlds.load import configured_scenario
from paani_tools.bench.board.table import BoardRun, board_table
from paani_tools.paper_report import published
from paani_tools.paper_report.stills import advice_when_stale, evidence_of, last_advice

COLUMNS = ("statement", "figure", "paper", "here", "n", "what differs")
OTHER_DATA = "its WaterScenes split is not at hand; here held-out sequences of other sources"
OTHER_MASKS = "its MaSTr1325 split is not at hand; here the recovered validation pictures, by our own measure"
MASK_SOURCE = "mastr1325"
BLACK = m.UnusableCause.BLACK


def detector_table(detector: Model) -> FigureTable:
    """Average precision over IoU 0.50 to 0.95 by class."""
    rows = []
    for name, paper in published.DETECTOR_VALIDATION.items():
        wanted = published.DETECTOR_CLASSES if name == "mean" else (name,)
        found = [each for label in wanted if (each := _figure(detector.figures, f"{label}_ap50_95"))]
        here, n = fmean(each.value for each in found), sum(each.n for each in found)
        rows.append((published.DETECTOR_STATEMENTS[name], f"AP50-95, {name}", paper, here, n, OTHER_DATA))
    return FigureTable(name="Detector", columns=COLUMNS, rows=tuple(rows))


def segmenter_table(segmenter: Model) -> FigureTable:
    """Intersection over union by class, and F1 of the water's edge."""
    rows = []
    for metric, paper in published.SEGMENTER.items():
        found = _figure(segmenter.figures, metric, MASK_SOURCE)
        here, n = (found.value, found.n) if found else (None, 0)
        rows.append(("V8", metric, paper, here, n, OTHER_MASKS))
    for metric, paper in published.INT8.items():
        why = "what ships is FP32: INT8 has to pass an acceptance test (`paani models quantise`)"
        rows.append(("V10", f"{metric}, INT8", paper, None, 0, why))
    return FigureTable(name="Segmenter", columns=COLUMNS, rows=tuple(rows))


def world_table(paper: Config) -> FigureTable:
    """The water of this profile beside the paper's lake."""
    world, route_n = configured_scenario(paper.world).world, f"{published.ROUTE_WAYPOINTS} waypoints"
    east_m, north_m = np.ptp(load_world(published.LAKE).shore_m, axis=0)
    laid = f"{len(world.route_m)} waypoints, {world.route_length_m:.3f} m"
    things, lake = f"{len(world.obstacles)} fixed, {len(world.actors)} moving", load_world(published.LAKE)
    others = f"world `{published.LAKE}` has banks, {len(lake.obstacles)} fixed and {len(lake.actors)} moving things"
    size = f"{published.LAKE_X_M:.3f} m x {published.LAKE_Y_M:.3f} m"
    rows = (
        ("K1", "lake", size, f"{east_m:.3f} m x {north_m:.3f} m", 1, "a far shore closes the view beyond it"),
        ("K2", "route", f"{route_n}, {published.ROUTE_M:.3f} m", laid, 1, "where the waypoints lie is not printed"),
        ("K3", "things in it", "0 fixed, 0 moving", things, 1, others),
    )
    return FigureTable(name="World, paper profile", columns=COLUMNS, rows=rows)


def stills_table(paper: Config, ours: Config) -> FigureTable:
    """The printed risks at the paper's policy and at the default one, and evidence that has gone stale."""
    rows = []
    for still in published.STILLS:
        evidence = evidence_of(still, paper)
        _, advice = last_advice(evidence, paper)
        seen = evidence if still.statement != "V15" else replace(evidence, usable=False, cause=BLACK)
        _, other = last_advice(seen, ours)
        risks = ", ".join(f"{lane.risk:.4f}" for lane in (advice.left, advice.center, advice.right))
        printed = f"{', '.join(f'{risk:.4f}' for risk in still.risks)}: {still.direction}"
        what = f"default profile: {other.direction} ({other.reason})"
        rows.append((still.statement, f"picture {still.picture}", printed, f"{risks}: {advice.direction}", 8, what))
    old = [advice_when_stale(evidence_of(still, paper), published.STALE_AGE_S, paper) for still in published.STILLS]
    stops = sum(each.direction is m.Direction.STOP for each in old)
    probes = f"{published.STALE_PROBES} of {published.STALE_PROBES} STOP"
    rows.append(
        ("V16", f"evidence {published.STALE_AGE_S} s old", probes, f"{stops} of {len(old)} STOP", len(old), "nothing")
    )
    return FigureTable(name="Single pictures, paper profile", columns=COLUMNS, rows=tuple(rows))


def board_tables(run: BoardRun | None) -> FigureTable:
    """The board protocol; without a run, the paper's column alone."""
    if run is not None:
        return board_table(run)
    why = "`paani bench board --profile paper --out DIR` measures it on the machine it runs on; then `--board DIR`"
    rows = (
        ("V17", "pipeline median / p95 / max [ms]", "467.842 / 580.341 / 643.857", None, 0, why),
        ("V18", "detector / segmenter median [ms]", "254.408 / 165.593", None, 0, why),
        ("V19", "cadence [Hz] / capture [pictures/s]", "0.500 / 2.58", None, 0, why),
        ("V20", "frame age at completion median / p95 [s]", "0.6838 / 0.8888", None, 0, why),
        ("V21", "CPU [%] / memory [MiB] / temperature [C]", "46.32 / 1665.7 / 45.3", None, 0, why),
        ("V22", "requests answered", "300 of 300", None, 0, why),
        ("V24", "power", "unavailable", None, 0, "no power meter"),
    )
    return FigureTable(name="Board protocol", columns=COLUMNS, rows=rows)


def _figure(figures: Sequence[Figure], metric: str, source: str = "all") -> Figure | None:
    return next((each for each in figures if (each.metric, each.source) == (metric, source)), None)
