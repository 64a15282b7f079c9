"""The tables: the paper's column, ours, n, and why they differ or cannot be compared. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import fmean

import numpy as np
from msgspec.structs import replace

from paani import messages as m
from paani.config import Config
from paani.statistics.figure_table import Cell, FigureTable
from paani_models.catalogue import Figure, Model
from paani_models.datasets.sources import RENDERED
from paani_models.report.experiments import Experiment
from paani_sim.vessels.vessel import load_vessel
from paani_sim.worlds import load_world
from paani_sim.worlds.load import configured_scenario
from paani_sim.worlds.scenario import Scenario
from paani_tools.bench.board.table import BoardRun, board_table
from paani_tools.paper_report import published
from paani_tools.paper_report.settings import BOAT, RUNTIME, figures_at
from paani_tools.paper_report.stills import advice_when_stale, evidence_of, last_advice

COLUMNS = ("statement", "figure", "paper", "here", "n", "what differs")
OTHER_DATA = (
    "The data differ: the paper's WaterScenes pictures are not at hand. Here stand held-out sequences of other sources "
    "and rendered pictures."
)
OTHER_MASKS = (
    "The data differ: of the paper's 198 validation pictures of MaSTr1325 here stand those that could be recovered."
)
SHIPPED = "what ships"
TRAINED = "the paper's, trained here"
BANDED = "recovered masks leave a band between the classes undecided, so that edges are not scored"
INT8_NOTE = "What ships is FP32: INT8 has to pass an acceptance test (`paani models quantise`)."
PAPER_SEGMENTER = "paper-segmenter"
UNFINISHED = "It had 16 of its recipe's 60 epochs, from random weights, not COCO's, and without rendered pictures."
NO_COUNTERPART = "no test part here; what was judged above is the ONNX file"
MASK_SOURCE = "mastr1325"
BLACK = m.UnusableCause.BLACK


def detector_table(detector: Model, whose: str) -> FigureTable:
    """Average precision by class, on the paper's validation pictures where not said otherwise.

    whose: what the heading says of the network.
    """
    rows = [_precision_row(detector, "V1", "AP50, mean", published.DETECTOR_AP50, "mean", "ap50")]
    for name, paper in published.DETECTOR_VALIDATION.items():
        rows.append(
            _precision_row(detector, published.DETECTOR_STATEMENTS[name], f"AP50-95, {name}", paper, name, "ap50_95")
        )
    for statement, what, printed in published.DETECTOR_OTHERS:
        rows.append((statement, what, printed, None, 0, NO_COUNTERPART))
    note = f"{OTHER_DATA} {UNFINISHED}" if whose == TRAINED else OTHER_DATA
    return FigureTable(name=f"Detector: {whose}", columns=COLUMNS, rows=tuple(rows), note=note)


def network_table(detector: Model, segmenter: Model, whose: str) -> FigureTable:
    """Size of the networks, and what the export changed. whose: as for `detector_table`."""
    rows: list[tuple[str, str, Cell, Cell, int, str]] = []
    for model, paper in ((detector, published.DETECTOR_NETWORK), (segmenter, published.SEGMENTER_NETWORK)):
        statements, parameters, megabytes, difference = paper
        network = model.architecture
        rows += [
            (statements[0], f"{model.name}, parameters", f"{parameters:,}", f"{model.parameters:,}", 1, network),
            (statements[1], f"{model.name}, file [MB]", megabytes, model.size_bytes * 1e-6, 1, network),
            ("T2", f"{model.name}, export, largest difference", difference, _small(model.export_max_abs_diff), 1,
             "1e-3 is the limit of both"),
        ]  # fmt: skip
    return FigureTable(name=f"Networks: {whose}", columns=COLUMNS, rows=tuple(rows))


def segmenter_table(segmenter: Model, whose: str) -> FigureTable:
    """Intersection over union by class, and F1 of the water's edge. whose: as for `detector_table`."""
    rows = []
    for statement, paper_figures in (("V8", published.SEGMENTER), ("V9", published.SEGMENTER_ONNX)):
        for metric, paper in paper_figures.items():
            found = _figure(segmenter.figures, metric, MASK_SOURCE) if statement == "V9" else None
            here, n = (found.value, found.n) if found else (None, 0)
            why = "the ONNX file was judged" if statement == "V8" else "24 of its pictures" if found else BANDED
            words = published.SEGMENTER_WORDS[metric]
            rows.append((statement, f"{words}, {published.ARTIFACTS[statement]}", paper, here, n, why))
    return FigureTable(name=f"Segmenter: {whose}", columns=COLUMNS, rows=tuple(rows), note=OTHER_MASKS)


def quantised_table(experiments: Sequence[Experiment]) -> FigureTable:
    """What the paper's segmenter, trained here, keeps as INT8 by the paper's recipe."""
    reached = {
        found.metric: (found.value, found.n, experiment.recipe)
        for experiment in experiments
        if experiment.net == PAPER_SEGMENTER and experiment.inference
        for found in experiment.figures
    }
    rows = tuple(
        ("V10", f"{published.SEGMENTER_WORDS[metric]}, INT8", paper, *reached.get(metric, (None, 0, BANDED)))
        for metric, paper in published.INT8.items()
    )
    return FigureTable(name=f"INT8: {TRAINED}", columns=COLUMNS, rows=rows, note=INT8_NOTE)


def settings_table(paper: Config, ours: Config) -> FigureTable:
    """Constants of the paper's profile and of its boat."""
    rows = []
    for statement, what, printed, names in RUNTIME:
        here, default = figures_at(paper, names), figures_at(ours, names)
        why = "nothing" if default == here else f"default profile: {default}"
        rows.append((statement, what, printed, here, len(names), why))
    boat = load_vessel(paper.plant.vessel or Scenario.vessel)
    rows += [
        (statement, what, printed, figures_at(boat, names), len(names), "nothing")
        for statement, what, printed, names in BOAT
    ]
    return FigureTable(name="Constants, paper profile", columns=COLUMNS, rows=tuple(rows))


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
    why = "not measured here"
    how = (
        "`paani bench board --profile paper --out DIR` measures these on the machine it runs on; "
        "`paani paper-report --board DIR` then has them."
    )
    rows = (
        ("V17", "pipeline median / p95 / max [ms]", "467.842 / 580.341 / 643.857", None, 0, why),
        ("V18", "detector / segmenter median [ms]", "254.408 / 165.593", None, 0, why),
        ("V19", "cadence [Hz] / capture [pictures/s]", "0.500 / 2.58", None, 0, why),
        ("V20", "frame age at completion median / p95 [s]", "0.6838 / 0.8888", None, 0, why),
        ("V21", "CPU [%] / memory [MiB] / temperature [C]", "46.32 / 1665.7 / 45.3", None, 0, why),
        ("V22", "requests answered", "300 of 300", None, 0, why),
        ("V24", "power", "unavailable", None, 0, "no power meter"),
    )
    return FigureTable(name="Board protocol", columns=COLUMNS, rows=rows, note=how)


def _precision_row(
    detector: Model, statement: str, what: str, paper: float, name: str, metric: str
) -> tuple[str, str, Cell, Cell, int, str]:
    wanted = published.DETECTOR_CLASSES if name == "mean" else (name,)
    found = [each for label in wanted if (each := _figure(detector.figures, f"{label}_{metric}"))]
    drawn = sum(each.n for label in wanted if (each := _figure(detector.figures, f"{label}_{metric}", RENDERED)))
    here, n = fmean(each.value for each in found) if found else None, sum(each.n for each in found)
    return statement, what, paper, here, n, f"{drawn} of these boxes are rendered"


def _small(difference: float) -> str:
    return f"{difference:.2e}"


def _figure(figures: Sequence[Figure], metric: str, source: str = "all") -> Figure | None:
    return next((each for each in figures if (each.metric, each.source) == (metric, source)), None)
