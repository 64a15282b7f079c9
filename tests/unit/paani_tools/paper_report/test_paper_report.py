"""`paani paper-report`: the paper's column is what its statements say, and ours is what ships and decides here."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import msgspec
import pytest

from paani import messages as m
from paani.cli import main as paani
from paani.config import load_config
from paani_models.catalogue import PAPER_WEIGHTS, WEIGHTS, Figure, load_catalogue
from paani_models.report.experiments import Experiment, read_experiments
from paani_services.advisor.tracker import tracks_message
from paani_tools.claims.statements import read_statements
from paani_tools.paper_report import published
from paani_tools.paper_report.command import markdown, report_text
from paani_tools.paper_report.recipes import DETECTOR, SEGMENTER, training_table
from paani_tools.paper_report.settings import BOAT, RUNTIME
from paani_tools.paper_report.stills import evidence_of, last_advice
from paani_tools.paper_report.tables import (
    BANDED,
    SHIPPED,
    TRAINED,
    board_tables,
    detector_table,
    network_table,
    quantised_table,
    segmenter_table,
    settings_table,
    stills_table,
    world_table,
)
from tests.unit.paani_tools.bench.board.test_board_figures import polls, run_of

CLASSES = published.DETECTOR_CLASSES
SAYS = {statement.id: statement.says for statement in read_statements()}
PAPER, OURS = load_config(profile="paper"), load_config()


NETWORKS = (published.DETECTOR_NETWORK, published.SEGMENTER_NETWORK)


def column(table: Any, name: str) -> list[Any]:
    return [row[table.columns.index(name)] for row in table.rows]


def test_the_papers_figures_are_those_of_its_statements() -> None:
    for name, value in published.DETECTOR_VALIDATION.items():
        assert f"{value:.6f}" in SAYS[published.DETECTOR_STATEMENTS[name]]
    assert all(f"{value:.6f}" in SAYS["V8"] for value in published.SEGMENTER.values())
    assert all(f"{value:.6f}" in SAYS["V9"] for value in published.SEGMENTER_ONNX.values())
    assert f"{published.DETECTOR_AP50:.6f}" in SAYS["V1"]
    for statement, _, printed in published.DETECTOR_OTHERS:
        assert all(figure in SAYS[statement] for figure in printed.split(" / ")), statement
    for (parameters, file), parameters_n, megabytes, difference in NETWORKS:
        assert f"{parameters_n:,}" in SAYS[parameters]
        assert f"{megabytes}" in SAYS[file]
        assert difference in SAYS["T2"]
    for statement, what, printed, _ in (*RUNTIME, *BOAT, *DETECTOR, *SEGMENTER):
        text = " ".join(SAYS[each] for each in statement.split())
        assert all(number in text for number in printed.split(" / ")), what
    assert all(f"{value:.6f}" in SAYS["V10"] for value in published.INT8.values())
    for still in published.STILLS:
        assert all(f"{risk:.4f}" in SAYS[still.statement] for risk in still.risks)
        assert still.direction in SAYS[still.statement]
    assert f"{published.STALE_AGE_S} s" in SAYS["V16"]
    table = board_tables(None)
    for statement, figures in zip(column(table, "statement"), column(table, "paper"), strict=True):
        numbers = [word for word in figures.replace("/", " ").split() if word[0].isdigit()]
        assert all(number.rstrip("0").rstrip(".") in SAYS[statement] for number in numbers), statement


@pytest.mark.slow
def test_pictures_are_decided_anew_and_the_papers_advice_comes_out() -> None:
    table = stills_table(PAPER, OURS)
    assert column(table, "here") == column(table, "paper")
    assert column(table, "statement") == ["V11", "V12", "V13", "V14", "V15", "V16"]
    assert "STOP (UNUSABLE_IMAGE)" in column(table, "what differs")[4]  # a black picture is refused here
    careful = load_config(profile="paper", sets=("advisor.policy.center_block_risk=0.2",))
    assert column(stills_table(careful, OURS), "here")[0] != column(table, "paper")[0]
    patient = load_config(profile="paper", sets=("advisor.evidence_max_age_s=10", "advisor.lifetime_s=20"))
    assert column(stills_table(patient, OURS), "here")[-1] == "1 of 5 STOP", "by its occupied side alone"


@pytest.mark.slow
def test_the_paper_profile_sails_the_papers_lake() -> None:
    table = world_table(PAPER)
    assert column(table, "here") == column(table, "paper")
    for name, figure in zip(column(table, "statement"), ("208.699 m", "465.443 m", ""), strict=True):
        assert figure in SAYS[name]
    assert "208.699 m by 126.000 m" in SAYS["K1"]
    assert "59 waypoints" in SAYS["K2"]
    assert column(world_table(OURS), "here")[1:] != column(table, "paper")[1:]


def test_figures_of_networks_are_the_manifests() -> None:
    catalogue = load_catalogue()
    detector, segmenter = catalogue["detector"], catalogue["segmenter"]
    figures = {(each.metric, each.source): each for each in (*detector.figures, *segmenter.figures)}
    table = detector_table(detector, SHIPPED)
    here = dict(zip(column(table, "figure"), column(table, "here"), strict=True))
    assert here["AP50-95, buoy"] == figures["buoy_ap50_95", "all"].value
    four = [figures[f"{name}_ap50_95", "all"].value for name in CLASSES]
    assert here["AP50-95, mean"] == pytest.approx(sum(four) / 4)
    masks = segmenter_table(segmenter, SHIPPED)
    found = dict(zip(column(masks, "figure"), column(masks, "here"), strict=True))
    assert found["IoU of water, ONNX"] == figures["iou_water", "mastr1325"].value
    assert (found["IoU of water, PyTorch"], found["F1 of edges, ONNX"]) == (None, None)
    assert here["AP50, mean"] == pytest.approx(0.25 * sum(figures[f"{name}_ap50", "all"].value for name in CLASSES))
    why = dict(zip(column(table, "figure"), column(table, "what differs"), strict=True))
    assert why["AP50-95, buoy"] == f"{figures['buoy_ap50_95', 'rendered'].n} of these boxes are rendered"
    sizes = column(network_table(detector, segmenter, SHIPPED), "here")
    assert sizes[:2] == [f"{detector.parameters:,}", detector.size_bytes * 1e-6]
    assert sizes[5] == f"{segmenter.export_max_abs_diff:.2e}"


@pytest.mark.slow
def test_the_papers_networks_trained_here_stand_beside_the_papers_figures() -> None:
    trained = load_catalogue(PAPER_WEIGHTS)
    table = network_table(trained["detector"], trained["segmenter"], TRAINED)
    paper, here = column(table, "paper"), column(table, "here")
    assert [here[0], here[3]] == [paper[0], paper[3]]  # parameters
    assert [here[1], here[4]] == pytest.approx([paper[1], paper[4]], rel=0.007)  # megabytes
    report = report_text(None)
    for part in (detector_table(trained["detector"], TRAINED), segmenter_table(trained["segmenter"], TRAINED), table):
        assert markdown(part) in report
        assert TRAINED in part.name


def test_what_the_papers_detector_reaches_here_is_said_beside_the_papers_figures() -> None:
    """Of all held-out boxes, each with its number and how many of them are rendered."""
    detector = load_catalogue(PAPER_WEIGHTS)["detector"]
    figures = {(each.metric, each.source): each for each in detector.figures}
    table = detector_table(detector, TRAINED)
    here = dict(zip(column(table, "figure"), column(table, "here"), strict=True))
    assert f"mAP50 {here['AP50, mean']:.3f} and mAP50-95 {here['AP50-95, mean']:.3f}" in SAYS["V1"]
    all_n = drawn_n = 0
    for label in CLASSES:
        fifty, over, drawn = (
            figures[f"{label}_{metric}", source]
            for metric, source in (("ap50", "all"), ("ap50_95", "all"), ("ap50_95", "rendered"))
        )
        statement = SAYS[published.DETECTOR_STATEMENTS[label]]
        assert f"AP50 {fifty.value:.3f} and AP50-95 {over.value:.3f} on {over.n} boxes, {drawn.n} of them" in statement
        assert here[f"AP50-95, {label}"] == over.value
        all_n, drawn_n = all_n + over.n, drawn_n + drawn.n
    assert f"on {all_n:,} boxes, {drawn_n:,} of them" in SAYS["V1"]
    assert "16 of its recipe's 60 epochs, from random weights, not COCO's, and without rendered" in table.note
    assert f"on {len({origin.name for origin in detector.origins})} other sources" in SAYS["V1"]
    assert not any(origin.name == "rendered" for origin in detector.origins)


@pytest.mark.slow
def test_int8_of_the_papers_segmenter_stands_beside_the_papers_figures() -> None:
    trained = Experiment("paper-segmenter", "0", "eighty pictures", (Figure("miou", "mastr1325", 0.9, 24),))
    quantised = msgspec.structs.replace(trained, figures=(Figure("miou", "mastr1325", 0.8, 24),), inference="INT8")
    table = quantised_table((msgspec.structs.replace(quantised, net="segmenter"), quantised, trained))
    assert table.rows == (
        ("V10", "mean IoU, INT8", published.INT8["miou"], 0.8, 24, "eighty pictures"),
        ("V10", "F1 of edges, INT8", published.INT8["edge_f1"], None, 0, BANDED),
    )
    assert markdown(quantised_table(read_experiments(WEIGHTS))) in report_text(None)


def test_the_paper_profile_has_the_constants_of_the_papers_tables() -> None:
    table = settings_table(PAPER, OURS)
    assert column(table, "here") == column(table, "paper")
    why = dict(zip(column(table, "figure"), column(table, "what differs"), strict=True))
    assert why["cruise / speed cap [m/s]"] == f"default profile: {OURS.navigator.cruise_mps:g} / 0.9"
    assert why["risk weights N / O / M / U"] == "nothing"
    assert column(settings_table(OURS, OURS), "here") != column(table, "paper")


@pytest.mark.train
def test_the_recipes_are_the_papers_where_they_can_be_read() -> None:
    pytest.importorskip("torch", reason="the extra `train` is not installed")
    table = training_table()
    assert column(table, "here")[:-1] == column(table, "paper")[:-1]


def test_without_pytorch_the_papers_recipe_stands_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [each for each in sys.modules if each.partition(".")[0] in {"torch", "paani_models"}]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "torch", None)
    table = training_table()
    assert set(column(table, "here")) == {None}
    assert all("extra `train`" in why for why in column(table, "what differs")[:-1])


@pytest.mark.slow
def test_the_report_is_one_page_of_tables(tmp_path: Path) -> None:
    file = tmp_path / "report.md"
    assert paani(["paper-report", "--out", str(file)]) == 0
    text = file.read_text(encoding="utf-8")
    assert text == report_text(None)
    assert [line for line in text.splitlines() if line.startswith("## ")] == [
        *(f"## {what}: {whose}" for what in ("Networks", "Detector", "Segmenter") for whose in (SHIPPED, TRAINED)),
        f"## INT8: {TRAINED}",
        "## Single pictures, paper profile", "## Constants, paper profile", "## World, paper profile",
        "## Training, the paper's recipes", "## Board protocol",
    ]  # fmt: skip
    assert "| V10 | mean IoU, INT8 | 0.7303 | 0.8877 | 24 |" in text
    assert markdown(board_tables(None)).count("| - | 0 |") == 7


@pytest.mark.parametrize("content", [None, b"{", b'{"run": {}}'])
def test_a_folder_without_a_run_is_named(
    tmp_path: Path, content: bytes | None, capsys: pytest.CaptureFixture[str]
) -> None:
    if content is not None:
        (tmp_path / "board.json").write_bytes(content)
    assert paani(["paper-report", "--board", str(tmp_path)]) == 2
    assert str(tmp_path / "board.json") in capsys.readouterr().err


@pytest.mark.slow
def test_a_run_of_the_board_protocol_takes_its_place(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = run_of(polls(12, 2.0), 12, {})
    (tmp_path / "board.json").write_bytes(msgspec.json.encode({"run": run, "polls": []}))
    assert paani(["paper-report", "--board", str(tmp_path)]) == 0
    printed = capsys.readouterr().out
    assert "paper, UNO Q" in printed
    assert "| 300 / 151 | 12 / 6 |" in printed


def test_each_of_the_papers_figures_stands_in_its_own_place() -> None:
    for still in published.STILLS:
        assert "{:.4f} left, {:.4f} center and {:.4f} right".format(*still.risks) in SAYS[still.statement]
    vessel = next(still.detection for still in published.STILLS if still.statement == "V12")
    assert vessel is not None
    assert f"confidence {vessel.confidence}" in SAYS["V12"]
    assert f"Each of {published.STALE_PROBES} probes" in SAYS["V16"]
    validation, others = (
        published.DETECTOR_VALIDATION,
        {row: text.split(" / ") for row, _, text in published.DETECTOR_OTHERS},
    )
    assert "mAP50 {} and mAP50-95 {}".format(*others["V3"]) in SAYS["V3"]
    assert f"mAP50 {published.DETECTOR_AP50:.6f} and mAP50-95 {validation['mean']:.6f}" in SAYS["V1"]
    assert "mAP50 {} and mAP50-95 {}".format(*others["V2"]) in SAYS["V2"]
    named = {row: what for row, what, _ in published.DETECTOR_OTHERS}
    for label in CLASSES:
        row = published.DETECTOR_STATEMENTS[label]
        test, onnx = others[row]
        assert f"For {label} the paper's AP50-95 is {validation[label]:.6f} on validation, " in SAYS[row]
        assert f"{test} on test and {onnx} with the ONNX file" in SAYS[row]
        assert named[row] == f"AP50-95, {label}, test / ONNX"
    assert f"{published.DETECTOR_NETWORK[3]} (detector) and {published.SEGMENTER_NETWORK[3]} (segmenter)" in SAYS["T2"]
    for row, found in (("V8", published.SEGMENTER), ("V9", published.SEGMENTER_ONNX)):
        assert (
            f"mIoU {found['miou']:.6f}, IoU {found['iou_water']:.6f} for water, {found['iou_obstacle']:.6f} for"
            f" obstacle and {found['iou_sky']:.6f} for sky, and edge F1 {found['edge_f1']:.6f}" in SAYS[row]
        )
    assert "mIoU {miou:.6f} and edge F1 {edge_f1:.6f}".format(**published.INT8) in SAYS["V10"]


@pytest.mark.slow
def test_v11_v12_v13_v14_v15_each_picture_is_decided_for_the_published_reason() -> None:
    for still in published.STILLS:
        evidence = evidence_of(still, PAPER)
        state, advice = last_advice(evidence, PAPER)
        assert (advice.direction, advice.reason) == (still.direction, still.reason), still.picture
        assert advice.right.occupied is (still.statement == "V14")
        if still.statement == "V12":
            [vessel] = tracks_message(state.tracker, evidence, PAPER.advisor).tracks
            assert (vessel.motion, vessel.motion_cause) == (m.MotionState.UNKNOWN, m.MotionCause.CLIPPED_BY_FRAME)


def test_y4_y5_the_papers_detector_has_a_row_of_each_artifact_and_split() -> None:
    table = detector_table(load_catalogue()["detector"], SHIPPED)
    others = {statement: (what, printed) for statement, what, printed in published.DETECTOR_OTHERS}
    assert column(table, "statement") == ["V1", *published.DETECTOR_STATEMENTS.values(), *others]
    assert list(others) == ["V2", "V3", "V4", "V5", "V6", "V7"]
    assert {row[0]: (row[1], row[2]) for row in table.rows[-len(others) :]} == others


SETTINGS = {  # the settings of the paper's tables by their statements, in the order of the rows
    "S2": "60 / 32 / 4 / 320", "S3": "0.001 / 0.0005 / 3 / 0.8 / 0.937 / 0.1 / 64", "S4": "7.5 / 0.5 / 1.5 / 42 / 12",
    "S5": "0.015 / 0.5 / 0.3 / 0.1 / 0.3 / 0.5 / 1 / 10",
    "S6": "50 / 16 / 4", "S7": "0.0003 / 0.0001 / 42",
    "S8": "0.5 / 0.5 / 0.2 / 0.2 / 0.2 / 0.05 / 0.35 / 0.7 / 0.6",
    "C6": "0.4", "C7 C8 C9": "256 / 0.45 / 24", "G2 G3 G4": "0.25 / 3 / 2", "G5": "0.65 / 0.02", "I5": "24 / 1.5",
    "I6": "5 / 0.4", "I16 I3": "0.75 / 0.04", "J4": "0.55 / 0.65 / 0.2 / 0.15", "J5": "0.48 / 0.58",
    "J16": "0.8 / 3.5", "J17": "0.5 / 5", "M7 N2": "0.15 / 0.3", "N5": "0.08 / 0.04", "N1 N6": "10 / 0.15",
    "O1 O2": "75 / 0.5", "Q3": "0.8 / 2", "Q4": "3 / 0.2", "Q5": "0.4 / 0.35 / 0.2", "Q6": "0.55 / 0.25 / 0.15",
    "K4 K6": "12.4 / 0.177", "K6": "650 / 90", "K7": "90 / 24 / 90 / 24", "K5": "4 / 20 / 20 / 80 / 4 / 25",
}  # fmt: skip


def test_y9_y10_y11_no_setting_of_the_papers_tables_is_left_out() -> None:
    found: dict[str, str] = {}
    for statement, _, printed, names in (*DETECTOR, *SEGMENTER, *RUNTIME, *BOAT):
        assert len(names) == len(printed.split(" / ")), statement
        found[statement] = f"{found[statement]} / {printed}" if statement in found else printed
    assert found == SETTINGS
