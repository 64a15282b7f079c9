"""`paani faults` on a small corpus of its own: every cell, the totals, the files it writes, and what it refuses."""

from __future__ import annotations

import json
from pathlib import Path
from xml.etree import ElementTree

import cv2
import numpy as np
import pytest

from paani.cli import main
from paani.messages import UnusableCause
from paani.picture_faults import FAULTS, GEOMETRIC_FAULTS
from paani_tools.faults.corpus import Scene
from paani_tools.faults.measure import CleanFigures, LevelFigures, count_classes, mean_iou, measure_levels, sum_up
from tests.pictures import noisy, river

pytestmark = pytest.mark.slow


@pytest.fixture
def corpus(tmp_path: Path) -> Path:
    """One source of two rivers with masks."""
    source = tmp_path / "data" / "rivers"
    for name in ("images", "masks"):
        (source / name).mkdir(parents=True)
    items = []
    for number in range(2):
        cv2.imwrite(str(source / "images" / f"{number}.png"), noisy(river(), 2.0, seed=number))
        mask = np.ones((240, 320), np.uint8)
        mask[:100] = 2
        cv2.imwrite(str(source / "masks" / f"{number}.png"), mask)
        items.append({"file": f"images/{number}.png", "seq": "a"})
    (source / "manifest.json").write_text(json.dumps({"items": items}))
    return tmp_path / "data"


def test_every_cell_is_measured(corpus: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    report, svg = tmp_path / "report.json", tmp_path / "curves.svg"
    assert main(["faults", str(corpus), "--scenes", "1", "--json", str(report), "--svg", str(svg)]) == 0
    found = json.loads(report.read_text())
    assert len(found["cells"]) == 5 * len(FAULTS | GEOMETRIC_FAULTS) + 1
    assert {cell["fault"] for cell in found["cells"]} >= {*FAULTS, *GEOMETRIC_FAULTS, "above_water"}
    black = next(cell for cell in found["cells"] if cell["fault"] == "black")
    assert (black["rejected"], black["n"]) == (1, 1)
    assert found["clean"] == [{"source": "rivers", "n": 2, "rejected": 0, "causes": []}]
    assert ElementTree.parse(svg).getroot().tag.endswith("svg")
    assert "let through where it must refuse" in capsys.readouterr().out


def test_only_listed_pictures_count(corpus: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    listed = tmp_path / "held.txt"
    listed.write_text("rivers/images/1.png\n")
    assert main(["faults", str(corpus), "--pictures", str(listed), "--scenes", "5"]) == 0
    assert "rivers                 1        0" in capsys.readouterr().out


def test_pictures_without_water_are_counted(corpus: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    dry, report = tmp_path / "dry.txt", tmp_path / "report.json"
    dry.write_text("rivers/images/0.png\nrivers/images/1.png\n")
    arguments = ["faults", str(corpus), "--scenes", "1", "--without-water", str(dry), "--json", str(report)]
    assert main(arguments) == 0
    found = json.loads(report.read_text())["without_water"]
    assert found == {"source": "without_water", "n": 2, "rejected": 0, "causes": []}
    assert "pictures without water: 0 of 2 refused" in capsys.readouterr().out


@pytest.mark.parametrize("what", ["nothing", "manifest", "list", "dry", "no picture"])
def test_mistakes_are_named(corpus: Path, what: str, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["faults", str(corpus)]
    if what == "nothing":
        arguments[1] = str(corpus / "rivers" / "images")
    elif what == "manifest":
        (corpus / "rivers" / "manifest.json").write_text("{")
    elif what == "no picture":
        (corpus / "dry.txt").write_text("rivers/images/7.png\n")
        arguments += ["--without-water", str(corpus / "dry.txt")]
    else:
        arguments += ["--pictures" if what == "list" else "--without-water", str(corpus / "none.txt")]
    assert main(arguments) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert str(corpus) in error


@pytest.mark.parametrize("option", ["--scenes=0", "--clean=-1", "--scenes=many"])
def test_impossible_numbers_are_refused(option: str, corpus: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        main(["faults", str(corpus), option])
    assert stop.value.code == 2
    assert f"argument {option.partition('=')[0]}: " in capsys.readouterr().err


def test_totals_are_shares_of_settled_cells() -> None:
    cells = (
        LevelFigures("rain", 1, 10, 0.9, 1),  # must be accepted, one refused
        LevelFigures("rain", 3, 10, 0.7, 7),  # either
        LevelFigures("rain", 5, 10, 0.4, 8),  # must be refused, two let through
        LevelFigures("above_water", 5, 10, 0.0, 10),
    )
    found = sum_up(cells, (CleanFigures("a", 40, 1), CleanFigures("b", 60, 0)))
    assert (found.false_accept_frac, found.false_reject_frac, found.clean_reject_frac) == (0.1, 0.1, 0.01)


def test_a_perfect_segmenter_and_a_deaf_gate() -> None:
    """The error is of the segmenter alone: what it says is compared with what the spoilt picture shows."""
    mask = np.zeros((240, 320), np.uint8)
    mask[:100] = 2
    scene = Scene("a", "s", river(), mask)
    answers = iter(measure_levels([scene], lambda bgr: mask[2::4, 2::4], lambda bgr: UnusableCause.NONE))
    first = next(answers)
    assert (first.fault, first.miou, first.rejected, first.verdict) == ("black", 1.0, 0, "accept")


def test_mean_iou_by_hand() -> None:
    truth = np.array([[0, 0, 1, 255]], np.uint8)
    predicted = np.array([[0, 1, 1, 2]], np.uint8)
    assert mean_iou(count_classes(predicted, truth)) == pytest.approx((1 / 2 + 1 / 2) / 2)
