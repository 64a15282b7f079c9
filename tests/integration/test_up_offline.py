"""The whole loop in a network namespace that holds nothing but loopback."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = [pytest.mark.integration, pytest.mark.timeout(180)]

ALONE = ("unshare", "--map-root-user", "--net", "sh", "-c")
UP = 'ip link set lo up && exec "$@"'


def may_be_alone() -> bool:
    """Whether this machine has the tools, and lets us."""
    return shutil.which("unshare") is not None and shutil.which("ip") is not None and _runs("true")


def _runs(command: str) -> bool:
    return subprocess.run([*ALONE, UP, "sh", command], capture_output=True, check=False).returncode == 0


@pytest.mark.skipif(not may_be_alone(), reason="no network namespace of one's own here (unshare, ip)")
def test_w13_the_loop_decides_without_any_network(tmp_path: Path, private_sets: tuple[str, ...]) -> None:
    """W13: pictures become thrust, and the boat goes its way, where no other host can be reached."""
    summary = tmp_path / "summary.json"
    sets = (*private_sets, "advisor.evidence_max_age_s=3.0")  # a busy machine is slow to look: not what is asked here
    words = [word for setting in sets for word in ("--set", setting)]
    command = [sys.executable, "-m", "paani", "up", "--headless", "--for", "8", "--summary", str(summary), *words]
    done = subprocess.run([*ALONE, UP, "sh", *command], capture_output=True, text=True, timeout=150, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    report = json.loads(summary.read_text())
    assert report["services"]["perception"]["rate_hz"] > 1.0
    assert sum(report["decisions"].values()) > 20
    assert report["distance_m"] > 1.0
