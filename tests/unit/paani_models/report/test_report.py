"""The report: four sections that never mix, tables with intervals, pictures outside the repository."""

from __future__ import annotations

import re
import shutil
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import cv2
import msgspec
import numpy as np
import pytest

from paani.errors import UserError
from paani.statistics.charts import bar, lines
from paani_models.catalogue import WEIGHTS
from paani_models.commands.models import main
from paani_models.datasets.sources import Sample, Source, choose_sources
from paani_models.detector.metrics import Detections
from paani_models.detector.scores import ScoredBoxes, confusion_counts
from paani_models.report.estimates import (
    Evaluation,
    draw_box_curves,
    estimate_boxes,
    estimate_false_alarms,
    estimate_masks,
    tabulate_box_confusion,
    tabulate_mask_confusions,
)
from paani_models.report.evidence import Evidence, Finding, Findings
from paani_models.report.experiments import read_experiments
from paani_models.report.manifest_figures import measure_segmenter
from paani_models.report.page import PageContent, page
from paani_models.report.records import (
    FaultCell,
    FaultReport,
    read_faults,
    read_training_record,
    render_training_charts,
)
from paani_models.segmenter.scores import ScoredMask
from tests.unit.paani_models.datasets.public_sets import own_data

pytestmark = pytest.mark.slow

RIVER = Source("river", "river", masks="masks", labels="labels", annotated=frozenset({"person", "vessel"}))
(DASHA,) = choose_sources(["tbiseg_dasha"])


def sample(sequence: str, source: Source = RIVER) -> Sample:
    return Sample(source, sequence, held_out=True, picture=Path(f"{sequence}.jpg"), mask=None, label=None)


def mask(sequence: str, right: int, wrong: int, source: Source = RIVER) -> ScoredMask:
    counts = np.array([[right, wrong, 0], [0, right, 0], [0, 0, right]], np.int64)
    return ScoredMask(sample(sequence, source), counts, np.array([1, 2, 1, 2], np.int64))


def boxes(sequence: str, *, found: int, true: int = 1) -> ScoredBoxes:
    """One true box of class `true` in the corner; one found there of class `found`, and nothing else."""
    box = np.array([[0, 0, 20, 20]], np.float32)
    truth = np.hstack([np.array([[true]], np.float32), box])
    return ScoredBoxes(sample(sequence), Detections(box, np.array([0.9], np.float32), np.array([found])), truth)


def evaluation() -> Evaluation:
    masks = [mask("a", 90, 10), mask("b", 50, 50), mask("c", 99, 1, DASHA)]
    scored = [boxes("a", found=1), boxes("b", found=0), boxes("b", found=1)]
    return Evaluation(
        estimates=(*estimate_masks(masks), *estimate_boxes(scored)),
        curves=draw_box_curves(scored),
        confusions=(*tabulate_mask_confusions(masks), tabulate_box_confusion(scored)),
    )


def test_estimates_are_per_source_and_per_sequence_with_intervals_u3() -> None:
    found = {(e.metric, e.source, e.sequence): e for e in evaluation().estimates}
    whole = found["iou_water", "river", ""]
    assert (whole.value, whole.n, whole.sequences) == (0.7, 2, 2)
    assert (whole.low, whole.high) == (0.5, 0.9)
    assert found["iou_water", "river", "b"].value == 0.5
    assert found["iou_water", "river", "b"].low is None
    assert found["iou_water", "tbiseg_dasha", ""].low is None
    assert ("miou", "tbiseg_dasha", "") not in found
    assert found["miou", "river", ""].value == pytest.approx(np.mean([0.7, 140 / 200, 1.0]), abs=1e-4)


def test_boxes_are_estimated_per_class_u1() -> None:
    found = {(e.metric, e.source, e.sequence): e for e in evaluation().estimates}
    assert found["vessel_ap50", "river", ""].n == 3
    assert found["vessel_recall_at_0.40", "all", ""].value == pytest.approx(2 / 3, abs=1e-4)
    assert found["vessel_ap50", "river", "a"].value == 1.0
    assert ("pier_ap50", "river", "") not in found


def test_false_alarms_are_a_rate_per_picture() -> None:
    samples = [sample("a", DASHA), sample("a", DASHA), sample("b", DASHA), sample("b", DASHA)]
    whole, first, second = estimate_false_alarms(samples, [0, 1, 3, 4])
    assert (whole.value, whole.low, whole.high, whole.n) == (2.0, 0.5, 3.5, 4)
    assert (first.value, second.value) == (0.5, 3.5)
    assert "per picture on rivers" in page(PageContent(Evaluation(estimates=(whole, first, second))))


def test_a_curve_ends_at_the_reached_recall_u1() -> None:
    curves = {curve.label: curve for curve in evaluation().curves}
    assert set(curves) == {"vessel"}
    assert curves["vessel"].precision[:67] == (1.0,) * 67
    assert curves["vessel"].precision[67:] == (0.0,) * 34


def test_box_confusion_by_hand() -> None:
    """A vessel found, a vessel called person, a buoy found where buoys are not annotated, an object missed."""
    missed = replace(
        boxes("c", found=1),
        detections=Detections(np.zeros((0, 4), np.float32), np.zeros(0, np.float32), np.zeros(0, int)),
    )
    stray = boxes("d", found=3, true=1)
    stray = replace(stray, truth=np.zeros((0, 5), np.float32))
    alarm = replace(boxes("e", found=0), truth=np.zeros((0, 5), np.float32))
    table = confusion_counts([boxes("a", found=1), boxes("b", found=0), missed, stray, alarm])
    assert table[1].tolist() == [1, 1, 0, 0, 1]
    assert table[4].tolist() == [1, 0, 0, 0, 0]
    assert table.sum() == 4
    assert (missed.mistakes, stray.mistakes, alarm.mistakes, boxes("a", found=1).mistakes) == (1, 0, 1, 0)


def finding(kind: Evidence) -> Finding:
    return Finding(evidence=kind, metric=f"of {kind}", source="a", value=0.5, n=3)


def test_four_sections_that_do_not_mix_u7() -> None:
    kinds = [Evidence.SCENARIOS, Evidence.TRAJECTORIES, Evidence.BOARD]
    text = page(PageContent(evaluation(), findings=[finding(kind) for kind in reversed(kinds)]))
    parts = re.findall(r'<section id="(\w+)">(.*?)</section>', text, re.DOTALL)
    assert [name for name, _ in parts] == list(Evidence)
    for kind in kinds:
        assert [name for name, body in parts if f"of {kind}" in body] == [kind]
    assert "water IoU" in parts[0][1]
    assert all("water IoU" not in body for _, body in parts[1:])


@pytest.mark.parametrize("other", [kind for kind in Evidence if kind is not Evidence.LABELLED])
def test_an_evaluation_of_another_class_is_refused_u7(other: Evidence) -> None:
    with pytest.raises(ValueError, match=other):
        page(PageContent(msgspec.structs.replace(evaluation(), evidence=other)))


def test_what_was_not_given_is_said() -> None:
    assert page(PageContent(evaluation())).count("Nothing was given for this class.") == 3


def test_the_page_asks_no_other_host_and_escapes_names() -> None:
    odd = Finding(evidence=Evidence.BOARD, metric="<script>", source="a&b", value=1, n=1)
    text = page(PageContent(evaluation(), findings=[odd], runs={"<run>": [{"epoch": 1.0, "loss": 2.0}]}))
    assert "//" not in text.replace("</", "")
    assert "<script>" not in text
    assert "<run>" not in text
    assert "a&amp;b" in text


def test_charts_are_well_formed() -> None:
    chart = lines({"a": [(0, 0.5), (1, 1.0)], "b": [(0, 0.5), (1, 1.0)], "none": []}, "x < y", "y", (0, 1))
    root = ElementTree.fromstring(chart)
    assert [e.text for e in root if e.get("class") == "name"] == ["a", "b"]
    heights = [float(e.get("y", "0")) for e in root if e.get("class") == "name"]
    assert abs(heights[0] - heights[1]) >= 13
    assert ElementTree.fromstring(bar(0.5, 0.4, 0.6)) is not None
    assert "whisker" not in bar(0.5, None, None)


def test_training_records_become_curves(tmp_path: Path) -> None:
    (tmp_path / "epochs.jsonl").write_text('{"epoch":1,"loss":2,"miou":0.5,"person":{"ap50":0.1,"n":9}}\n')
    rows = read_training_record(tmp_path)
    assert rows == [{"epoch": 1.0, "loss": 2.0, "miou": 0.5, "person ap50": 0.1, "person n": 9.0}]
    charts = render_training_charts(rows)
    assert charts.count("<svg") == 2
    assert "person ap50" in charts
    assert "person n" not in charts
    assert render_training_charts([]) == ""


def test_bad_records_are_named(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"holds neither epochs\.jsonl"):
        read_training_record(tmp_path)
    (tmp_path / "epochs.jsonl").write_text('{"epoch":1}\n{\n')
    with pytest.raises(UserError, match=r"epochs\.jsonl:2"):
        read_training_record(tmp_path)
    with pytest.raises(UserError, match=r"faults\.json"):
        read_faults(tmp_path / "faults.json")
    (tmp_path / "epochs.jsonl").write_text('{"loss": ' + "9" * 400 + "}\n")
    with pytest.raises(UserError, match=r"epochs\.jsonl:1: "):
        read_training_record(tmp_path)


def test_faults_are_drawn() -> None:
    cells = tuple(FaultCell("heavy_blur", severity, 10, severity, 0.5) for severity in range(1, 6))
    text = page(PageContent(evaluation(), faults=FaultReport(cells)))
    assert "heavy blur" in text
    assert "Below 0.60" in text


@pytest.fixture
def data(tmp_path: Path) -> Path:
    return own_data(tmp_path / "data")


def report(data: Path, out: Path, *more: str) -> int:
    return main(["report", "--data", str(data), "--sources", "tbiseg_dasha,mcoe_boats", "--out", str(out), *more])


def test_a_whole_report_of_a_miniature(data: Path, tmp_path: Path) -> None:
    (tmp_path / "board.json").write_bytes(
        msgspec.json.encode(Findings(evidence=Evidence.BOARD, findings=(finding(Evidence.BOARD),)))
    )
    out = tmp_path / "report"
    (out / "pictures").mkdir(parents=True)
    for name in ("index.html", "pictures/old.jpg"):
        (out / name).write_text("of an earlier report")
    assert report(data, out, "--evidence", str(tmp_path / "board.json")) == 0
    text = (out / "index.html").read_text()
    named = set(re.findall(r'src="([^"]+)"', text))
    assert named == {str(path.relative_to(out)) for path in (out / "pictures").iterdir()}
    assert any("mask_" in name for name in named)
    assert any("boxes_" in name for name in named)
    assert "of board_logs" in text
    written = msgspec.json.decode((out / "evaluation.json").read_bytes(), type=Evaluation)
    assert {e.source for e in written.estimates} == {"tbiseg_dasha", "mcoe_boats", "all"}
    assert [m.name for m in written.models] == ["segmenter", "detector"]
    assert all(text.count(title) for title in ("what was tried", "where its mistakes lie", "what limits it"))
    measured = [row for row in read_experiments(out) if not row.inference and row.sha256 == written.models[0].sha256]
    assert [figure.n for row in measured for figure in row.figures] == [4]


def test_pictures_never_get_into_the_repository(data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "checkout" / ".git").mkdir(parents=True)
    inside = tmp_path / "checkout" / "tests" / "report"
    assert report(data, inside) == 2
    assert "is inside the repository" in capsys.readouterr().err
    assert not inside.exists()


def test_labelled_figures_cannot_be_brought_from_a_file_u7(
    data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "mine.json"
    path.write_bytes(msgspec.json.encode(Findings(evidence=Evidence.LABELLED, findings=())))
    assert report(data, tmp_path / "report", "--evidence", str(path)) == 2
    assert "mine.json: figures on labelled pictures are measured here" in capsys.readouterr().err
    assert not (tmp_path / "report").exists()


def test_evaluate_writes_the_same_json_twice(data: Path, tmp_path: Path) -> None:
    command = ["evaluate", "detector", "--data", str(data), "--sources", "tbiseg_dasha,mcoe_boats", "--json"]
    for name in ("a.json", "b.json"):
        assert main([*command, str(tmp_path / name)]) == 0
    assert (tmp_path / "a.json").read_bytes() == (tmp_path / "b.json").read_bytes()


def test_an_unknown_net_is_named(data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["evaluate", "nonsense", "--data", str(data), "--sources", "tbiseg_dasha"]) == 2
    assert "no segmenter or detector named 'nonsense'" in capsys.readouterr().err


def test_nothing_measured_records_nothing(data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    weights = Path(shutil.copytree(WEIGHTS, tmp_path / "weights"))
    pictures = ["--weights", str(weights), "--data", str(data), "--sources", "tbiseg_dasha,mcoe_boats"]
    faults, manifest = tmp_path / "faults.json", (weights / "manifest.json").read_bytes()
    faults.write_bytes(msgspec.json.encode(FaultReport(cells=())))
    assert main(["evaluate", "--faults", str(faults), "--record", *pictures]) == 2
    assert "nothing was measured of gate" in capsys.readouterr().err
    assert (weights / "manifest.json").read_bytes() == manifest


@pytest.mark.rotating(cpu_s=4)
def test_a_class_that_is_nowhere_has_no_figure(tmp_path: Path) -> None:
    water = np.random.default_rng(1).normal((90, 80, 60), 6.0, (240, 320, 3)).clip(0, 255).astype(np.uint8)
    picture, truth = tmp_path / "a.png", tmp_path / "mask.png"
    assert cv2.imwrite(str(picture), water)
    assert cv2.imwrite(str(truth), np.ones((240, 320), np.uint8))
    on_water = replace(sample("a"), picture=picture, mask=truth)
    figures = measure_segmenter(WEIGHTS / "segmenter.onnx", [on_water])
    assert [f.metric for f in figures] == ["iou_water", "iou_obstacle", "miou", "edge_f1", "max_water_frac"]
