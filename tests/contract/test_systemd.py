"""The units of deploy/systemd: systemd takes them, they are closed, and they start each side's processes."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from paani.keys import PORTS, Graph
from paani.sides import Side, services_on

ROOT = Path(__file__).parents[2]
UNITS = ROOT / "deploy" / "systemd"
MAX_EXPOSURE = 25  # tenths, of systemd's scale: below 2.5 of 10 where most of its own services have 5 to 9


def wanted(target: str) -> set[str]:
    text = (UNITS / f"paani-{target}.target").read_text(encoding="utf-8")
    return set(re.findall(r"paani@(\w+)\.service", text))


@pytest.mark.parametrize("side", [Side.BOARD, Side.HOST])
def test_a_target_starts_its_sides_processes(side: Side) -> None:
    assert wanted(side) == set(services_on(side, Graph.HULL)) - {*PORTS}


@pytest.fixture
def installed(tmp_path: Path) -> Path:
    """A root in which the units lie where systemd looks for them, and what they run is there."""
    if shutil.which("systemd-analyze") is None:
        pytest.skip("no systemd here (Debian package systemd)")
    folder = tmp_path / "etc/systemd/system"
    folder.mkdir(parents=True)
    for unit in UNITS.glob("paani*"):
        shutil.copy(unit, folder)
    for name in ("network", "time-sync", "multi-user", "basic", "sysinit", "shutdown", "time-set"):
        (folder / f"{name}.target").write_text("[Unit]\n")
    program = tmp_path / "opt/paani/bin/paani"
    program.parent.mkdir(parents=True)
    program.write_text("#!/bin/sh\n")
    program.chmod(0o755)
    return tmp_path


def test_systemd_takes_the_units(installed: Path) -> None:
    units = ["paani@advisor.service", "paani@router.service", "paani-board.target", "paani-host.target"]
    result = subprocess.run(
        ["systemd-analyze", "verify", "--man=no", f"--root={installed}", *units],
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stderr
    own = "paani@router.service: Dependency After=paani@router.service is dropped."  # all start after the router
    assert [line for line in result.stderr.splitlines() if "paani" in line and line != own] == []


def test_the_units_are_closed_to_what_they_do_not_need(installed: Path) -> None:
    result = subprocess.run(
        [
            "systemd-analyze", "security", "--offline=yes", f"--root={installed}", f"--threshold={MAX_EXPOSURE}",
            "--no-pager", "paani@advisor.service",
        ],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert result.returncode == 0, result.stdout[-800:] + result.stderr
