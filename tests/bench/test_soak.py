"""Five minutes of a drive: no process is started again, grows, or keeps what it opens."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import msgspec
import pytest

from paani.config import Config
from paani_tools.bench.soak import SoakReport

DRIVEN_S = 300.0
# Five minutes do not show 1 MiB an hour: what lies in gaps of the heap goes up and down by 1 MiB between two looks.
MAX_LASTING_SLOPE_MIB_H = 60.0

pytestmark = [pytest.mark.integration, pytest.mark.timeout(DRIVEN_S + 120)]


@pytest.mark.rotating(cpu_s=280)
def test_five_minutes_of_a_drive(private_sets: tuple[str, ...], tmp_path: Path) -> None:
    words = [word for setting in private_sets for word in ("--set", setting)]
    result = subprocess.run(
        [sys.executable, "-m", "paani", "bench", "soak", "--for", f"{DRIVEN_S:g}", "--json", tmp_path / "soak", *words],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert result.returncode in {0, 1}, result.stderr  # 1: the bar of an hour was not kept
    report = msgspec.json.decode((tmp_path / "soak").read_bytes(), type=SoakReport)
    assert set(report.processes) == set(Config().services) - {"recorder"}
    assert report.driven_s >= DRIVEN_S
    assert report.distance_m > 0
    assert report.decisions_hz > 1.0
    for name, one in report.processes.items():
        assert one.restarts == 0, name
        assert one.lasting_slope_mib_h < MAX_LASTING_SLOPE_MIB_H, name
        assert one.descriptors[1] <= one.descriptors[0] + 2, name
        assert one.threads[1] <= one.threads[0] + 2, name
