"""`paani bench judgement` prints what it promises; the figures are for reading."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from paani import keys
from paani import messages as m
from paani.errors import UserError
from paani.statistics.figure_table import FigureTable, table_text
from paani_tools.bench.judgement import BOXES, crowded_evidence
from paani_tools.bench.steadiness import steadiness
from tests.unit.paani.logs.small_logs import START_US, begin, put

pytestmark = pytest.mark.integration


def bench(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "paani", "bench", "judgement", *words], capture_output=True, text=True, check=False
    )


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


def test_dithering_counts_a_recorded_drive_by_both_profiles(tmp_path: Path) -> None:
    log = begin(tmp_path)
    for number, evidence in enumerate(crowded_evidence(40)):
        sent_us = START_US + number * 200_000
        stamped = m.Evidence(**{
            **{name: getattr(evidence, name) for name in evidence.__struct_fields__},
            "source_us": sent_us - 150_000, "seq": number, "epoch": 5, "producer": "perception", "sent_us": sent_us,
        })  # fmt: skip
        put(log, keys.EVIDENCE, stamped)
    log.finish({})
    part = steadiness([log.path])
    assert {row[1] for row in part.rows} >= {"paper", "paani"}
    for row in part.rows:
        assert row[0] == log.path.name
        assert row[2] == 8  # 39 periods, to the last step
        assert isinstance(row[3], int)
        assert row[3] > 0
    with pytest.raises(UserError, match="absent"):
        steadiness([tmp_path / "absent.mcap"])


def test_a_table_has_numbers_to_the_right() -> None:
    part = FigureTable(name="a", columns=("what", "n"), rows=(("x", 1.5), ("long", None)), note="b")
    assert table_text(part) == "a\nwhat      n\nx     1.500\nlong      -\nb\n"


def test_the_pictures_are_crowded_and_the_same_every_time() -> None:
    first = list(crowded_evidence(30))
    assert first == list(crowded_evidence(30))
    assert all(len(evidence.detections) == BOXES for evidence in first)
