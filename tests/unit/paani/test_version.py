"""Release and commit."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from paani.cli import main
from paani.version import UNKNOWN, commit

IDENTITY = ("-c", "user.name=a", "-c", "user.email=a@b")


def git(folder: Path, *words: str) -> str:
    if shutil.which("git") is None:
        pytest.skip("no git here")
    done = subprocess.run(["git", *IDENTITY, *words], cwd=folder, capture_output=True, text=True, check=True)
    return done.stdout.strip()


def test_a_checkout_is_known_by_its_commit_and_whether_files_were_changed(tmp_path: Path) -> None:
    git(tmp_path, "init", "-q")
    file = tmp_path / "file"
    file.write_text("a")
    git(tmp_path, "add", ".")
    git(tmp_path, "commit", "-q", "-m", "a")
    head = git(tmp_path, "rev-parse", "--short=12", "HEAD")
    assert commit(tmp_path / "nothing", tmp_path) == head
    file.write_text("b")
    assert commit(tmp_path / "nothing", tmp_path) == f"{head}-dirty"


def test_what_a_wheel_carries_counts_before_the_folder_around_it(tmp_path: Path) -> None:
    git(tmp_path, "init", "-q")
    (tmp_path / "commit.txt").write_text("0123456789ab\n")
    assert commit(tmp_path, tmp_path) == "0123456789ab"


def test_no_commit_is_taken_from_a_repository_further_up(tmp_path: Path) -> None:
    git(tmp_path, "init", "-q")
    git(tmp_path, "commit", "-q", "--allow-empty", "-m", "a")
    (tmp_path / "below").mkdir()
    assert commit(tmp_path / "below", tmp_path / "below") == UNKNOWN


@pytest.mark.slow
def test_the_command_tells_release_and_commit(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"paani 0.1.0 (commit {commit()})\n"
