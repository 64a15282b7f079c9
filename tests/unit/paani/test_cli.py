"""Commands and services by name."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from paani.cli import main
from tests.unit.paani.logs.small_logs import NAME, finished, unfinished


@pytest.mark.slow
def test_run_starts_a_service_even_where_a_command_has_its_name(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["run", "sensors", "--help"])
    assert "Run the sensors process" in capsys.readouterr().out
    with pytest.raises(SystemExit):
        main(["sensors", "--help"])
    assert "What each GPS" in capsys.readouterr().out


@pytest.mark.parametrize("words", [["run"], ["run", "bench"], ["run", "no_such"]])
def test_run_names_what_it_can_start(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(words) == 2
    errors = capsys.readouterr().err
    assert len(errors.splitlines()) == 1
    assert "sensors" in errors


def run_in_shell(line: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """A line of bash; `$PAANI` is the command."""
    environment = {**os.environ, "PAANI": f"{sys.executable} -m paani"}
    command = ["bash", "-o", "pipefail", "-c", line]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False, timeout=60)


@pytest.mark.slow
def test_a_reader_that_goes_away_makes_no_success_of_a_failure(tmp_path: Path) -> None:
    unfinished(tmp_path, 20, 10)
    assert run_in_shell(f"$PAANI logs info {NAME} | cat", tmp_path).returncode == 1
    done = run_in_shell(f"$PAANI logs info {NAME} | true", tmp_path)
    assert (done.returncode in {1, 141}, "Traceback" in done.stderr) == (True, False)


@pytest.mark.slow
def test_a_closed_output_and_a_name_of_bytes_are_no_crash(tmp_path: Path) -> None:
    finished(tmp_path, 20, 10)
    done = run_in_shell(f"$PAANI logs info {NAME} >&-", tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert run_in_shell("$PAANI nothing 2>&-", tmp_path).returncode == 2
    line = "thrusters.line=serial:/dev/ttyACM1@115200"
    done = run_in_shell(f"$PAANI calibrate thrusters --out x --set {line} <&-", tmp_path)
    assert (done.returncode, done.stderr.count("\n"), "needs a terminal" in done.stderr) == (2, 1, True)
    done = run_in_shell(f"mv {NAME} $'n\\xff.mcap' && $PAANI logs info --json $'n\\xff.mcap'", tmp_path)
    assert done.returncode == 0
    assert json.loads(done.stdout)["path"] == "n\udcff.mcap"
