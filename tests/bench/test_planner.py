"""`paani bench planner` measures what it promises; the figures are for reading."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.places import ROOT

pytestmark = pytest.mark.integration


def bench(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "paani", "bench", "planner", *words], capture_output=True, text=True, check=False
    )


@pytest.mark.slow
def test_twelve_obstacles_are_planned_for_and_a_recording_is_planned_again(tmp_path: Path) -> None:
    drive = next(ROOT.glob("tests/**/*.mcap"))
    result = bench("--steps", "3", "--drive", str(drive), "--json", str(tmp_path / "figures.json"))
    assert result.returncode == 0, result.stderr
    crowded, recorded = json.loads((tmp_path / "figures.json").read_text())["parts"]
    # All twelve are known to move; a swimmer who was hidden for long is remembered where he was as well.
    assert [(row[0], *row[4:]) for row in crowded["rows"]] == [("map", 3, 13), ("plan", 3, 13), ("step", 3, 13)]
    assert all(0.0 < p50 <= p95 <= p99 for _, p50, p95, p99, *_ in crowded["rows"])
    ((name, *_, steps, _),) = recorded["rows"]
    assert (name, steps > 0) == (drive.name, True)


def test_a_log_that_is_none_is_one_line() -> None:
    result = bench("--steps", "1", "--drive", "/no/log.mcap")
    assert (result.returncode, "/no/log.mcap" in result.stderr, result.stderr.count("\n")) == (2, True, 1)
