"""The sheet of misses and false alarms, and what `evaluate` prints beside it."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from paani_models.commands.models import main
from paani_models.datasets.sources import Sample, Source
from paani_models.detector.metrics import Detections
from paani_models.report.height_scores import DetectorRun, PictureResult
from paani_models.report.miss_sheet import find_mistakes, render_sheet
from tests.unit.paani_models.datasets.public_sets import own_data, scene, write_picture

RIVER = Source("river", "river", labels="labels", annotated=frozenset({"person"}))


def found(*rows: tuple[float, float, float, float, float]) -> Detections:
    table = np.array(rows, np.float32).reshape(-1, 5)
    return Detections(table[:, 1:], table[:, 0], np.zeros(len(table), np.int64))


@pytest.fixture
def result(tmp_path: Path) -> PictureResult:
    """Two people; `own` finds the first and raises an alarm, `other` finds both and raises the same."""
    picture = tmp_path / "two.jpg"
    write_picture(picture, scene(3, (320, 240)))
    truth = np.array([(0, 10, 10, 40, 90), (0, 100, 10, 130, 60)], np.float32)
    alarm, first, second = (0.6, 200, 50, 240, 90), (0.9, 10, 10, 40, 90), (0.8, 100, 10, 130, 60)
    boxes = {"own": found(first, alarm, (0.3, *second[1:])), "other": found(first, second, alarm)}
    return PictureResult(Sample(RIVER, "a", True, picture, None, None), truth, boxes)


def never(*_: object) -> Detections:
    raise AssertionError


RUNS = [DetectorRun(name, frozenset({"person"}), never) for name in ("own", "other")]


def test_misses_and_false_alarms_with_who_saw_them_too(result: PictureResult) -> None:
    missed, alarm = sorted(find_mistakes([result], "own", RUNS), key=lambda m: m.score)
    assert missed.is_miss
    assert missed.box.tolist() == [100, 10, 130, 60]
    assert missed.seen_by == ("other",)
    assert alarm.score == pytest.approx(0.6)
    assert alarm.seen_by == ("other",)
    assert [m.is_miss for m in find_mistakes([result], "other", RUNS)] == [False]


def test_the_sheet_holds_its_pictures_and_counts(result: PictureResult) -> None:
    sheet = render_sheet("Mistakes", find_mistakes([result], "own", RUNS))
    assert "person, river: 1 missed" in sheet
    assert "person, river: 1 false alarm<" in sheet
    assert len(re.findall("data:image/jpeg;base64,", sheet)) == 2
    assert "http" not in sheet


@pytest.mark.slow
def test_evaluate_prints_the_table_and_skips_what_is_broken(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A box outside, and a source without a manifest: named, skipped, counted; no sheet inside a repository."""
    data = own_data(tmp_path / "data")
    (data / "mcoe_boats" / "labels" / "boat5.txt").write_text("1 1.5 .5 .2 .2\n")
    command = ["evaluate", "detector", "--data", str(data), "--sources", "mcoe_boats,pennfudan", "--html"]
    assert main([*command, str(tmp_path / "sheet.html")]) == 0
    printed = capsys.readouterr()
    assert re.search(r"^vessel +mcoe_boats +any +1 +1 +detector ", printed.out, re.MULTILINE)
    assert "skipped source pennfudan" in printed.err
    assert re.search(r"skipped picture boat5\.jpg: .*boat5\.txt:1: a box outside the picture", printed.err)
    assert "skipped 2 in all" in printed.err
    assert "no off-the-shelf networks beside it" in printed.err
    assert "missed" in (tmp_path / "sheet.html").read_text()
    (tmp_path / "checkout" / ".git").mkdir(parents=True)
    assert main([*command, str(tmp_path / "checkout" / "sheet.html")]) == 2
    assert "is inside the repository" in capsys.readouterr().err
    assert not (tmp_path / "checkout" / "sheet.html").exists()


def test_where_no_source_is_left_it_is_an_error(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["evaluate", "detector", "--data", str(tmp_path), "--sources", "pennfudan"]) == 2
    assert "pennfudan" in capsys.readouterr().err
