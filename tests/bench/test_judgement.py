"""`paani bench judgement` prints what it promises; the figures are for reading."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from paani import keys
from paani.errors import UserError
from paani.logs.reader import open_log
from paani.statistics.figure_table import FigureTable, table_text
from paani_tools.bench.judgement import BOXES, crowded_evidence
from paani_tools.bench.steadiness import steadiness
from paani_tools.logs.info import info_of
from paani_tools.replay.compatibility import provenance_of
from paani_tools.replay.verify import check_log
from tests.places import ROOT
from tests.unit.paani.logs.small_logs import begin, put

pytestmark = pytest.mark.integration


def bench(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "paani", "bench", "judgement", *words], capture_output=True, text=True, check=False
    )


@pytest.mark.rotating(cpu_s=4)
def test_step_and_contract(tmp_path: Path) -> None:
    result = bench("--frames", "5", "--only", "step", "--only", "contract", "--json", str(tmp_path / "figures.json"))
    assert result.returncode == 0, result.stderr
    assert [file.name for file in tmp_path.iterdir()] == ["figures.json"]
    figures = json.loads((tmp_path / "figures.json").read_text())
    assert figures["machine"].keys() == {"cores", "load_before", "load_after"}
    step, contract = figures["parts"]
    assert [row[0] for row in step["rows"]] == ["frame", "frame, counterfactual", "republish"]
    judged = {row[0]: row[-1] for row in step["rows"]}
    assert judged["frame"] == judged["republish"] == 0 < judged["frame, counterfactual"] <= 3303
    assert {row[0] for row in contract["rows"]} == {"Evidence", "Tracks", "Advisory"}
    for kind in ("Evidence", "Tracks", "Advisory"):
        sizes = [row[2] for row in contract["rows"] if row[0] == kind]
        assert sizes == sorted(sizes)  # typed, in a string, in a string by the json library
    assert all(row[0] in result.stdout for part in (step, contract) for row in part["rows"])


@pytest.mark.parametrize(
    ("words", "named"),
    [(("--only", "nothing"), "--only nothing"), (("--only", "contract", "--frames", "1", "--json", "/no/f"), "/no/f")],
)
def test_a_mistake_is_one_line(words: tuple[str, ...], named: str) -> None:
    result = bench(*words)
    assert result.returncode == 2
    assert named in result.stderr
    assert len(result.stderr.splitlines()) == 1


def test_dithering_agrees_with_logs_info_and_with_the_replay() -> None:
    """The recorded advice, decided again step by step by the drive's own settings, changes as often as the log says."""
    path = ROOT / "tests" / "replay" / "river_paper.mcap"
    log = open_log(path)
    info = info_of(log)
    assert check_log(log, provenance_of(log, force=True).config).differ == 0
    rows = {str(row[1]): row for row in steadiness([path]).rows}
    assert rows["as recorded"][2:] == rows["its settings"][2:]
    assert rows["as recorded"][3] == 3
    assert info.direction_changes_per_min == round(60 * 3 / info.duration_s, 2)
    assert rows["paper"][2:] == rows["as recorded"][2:]  # the drive was one of that profile


def test_dithering_counts_other_settings_on_what_was_recorded() -> None:
    """A drive whose camera went black changes as its log says; the paper, which checks no picture, otherwise."""
    path = ROOT / "tests" / "replay" / "river_camera_black.mcap"
    rows = {str(row[1]): row for row in steadiness([path]).rows}
    assert info_of(open_log(path)).direction_changes_per_min == 8.0
    assert (rows["as recorded"][2], rows["as recorded"][3]) == (30, 4)
    assert rows["paper"][3] != 4


def test_dithering_needs_steps_to_decide_again(tmp_path: Path) -> None:
    log = begin(tmp_path)
    put(log, keys.EVIDENCE, next(iter(crowded_evidence(1))))
    log.finish({})
    with pytest.raises(UserError, match=f"{log.path}: no steps of the advisor"):
        steadiness([log.path])
    with pytest.raises(UserError, match="absent"):
        steadiness([tmp_path / "absent.mcap"])


def test_a_table_has_numbers_to_the_right() -> None:
    part = FigureTable(name="a", columns=("what", "n"), rows=(("x", 1.5), ("long", None)), note="b")
    assert table_text(part) == "a\nwhat      n\nx     1.500\nlong      -\nb\n"


def test_the_pictures_are_crowded_and_the_same_every_time() -> None:
    first = list(crowded_evidence(30))
    assert first == list(crowded_evidence(30))
    assert all(len(evidence.detections) == BOXES for evidence in first)
