"""`paani bench recorder` prints what it promises; the figures are for reading."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = [pytest.mark.integration, pytest.mark.timeout(150)]


@pytest.mark.rotating(cpu_s=20)
def test_bench_recorder(tmp_path: Path, private_sets: tuple[str, ...]) -> None:
    file = tmp_path / "figures.json"
    words = [word for setting in private_sets for word in ("--set", setting)]
    result = subprocess.run(
        [sys.executable, "-m", "paani", "bench", "recorder", "--for", "4", "--json", str(file), *words],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert result.returncode == 0, result.stderr
    [part] = json.loads(file.read_text())["parts"]
    figures = dict(part["rows"])
    assert figures["CPU of the recorder [% of a core]"] > 0
    assert figures["messages a second"] > 100
    assert figures["pictures a second"] > 2
    assert figures["dropped"] == 0
    assert all(name in result.stdout for name in figures)
