"""Perception's own journal is bounded, whatever comes and whatever breaks."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from paani.logs.folder import NAME as RECORDING
from paani.runtime import LOGS
from paani_services.perception.journal import JOURNAL_FOLDER, NEWER_FILE, OLDER_FILE, Journal


def lines(folder: Path) -> list[bytes]:
    """Oldest first."""
    files = [folder / OLDER_FILE, folder / NEWER_FILE]
    return [line for file in files if file.exists() for line in file.read_bytes().splitlines()]


def size(folder: Path) -> int:
    return sum(file.stat().st_size for file in folder.iterdir())


@pytest.mark.slow
def test_the_newest_are_kept_and_the_size_is_bounded(tmp_path: Path) -> None:
    """P2: perception has its own bounded observation journal."""
    journal = Journal(tmp_path / "journal", 1000)
    for number in range(500):
        assert journal.append(json.dumps({"number": number}).encode())
        assert size(tmp_path / "journal") <= 1000
        assert len(lines(tmp_path / "journal")) >= min(number, 25), "at least the half"
    kept = [json.loads(line)["number"] for line in lines(tmp_path / "journal")]
    assert kept == list(range(500 - len(kept), 500))


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None, max_examples=30)
@given(st.lists(st.binary(max_size=300).map(lambda data: data.hex().encode()), max_size=30), st.integers(0, 1000))
@pytest.mark.slow
def test_the_bound_holds_for_any_lines(tmp_path: Path, written: list[bytes], max_bytes: int) -> None:
    """Property: the bound holds, and what is kept is the end of what was taken."""
    folder = tmp_path / "j"
    for name in (NEWER_FILE, OLDER_FILE):
        (folder / name).unlink(missing_ok=True)
    journal = Journal(folder, max_bytes)
    taken = [line for line in written if journal.append(line)]
    if max_bytes // 2 == 0:
        assert not folder.exists() or size(folder) == 0
        return
    kept = lines(folder) if folder.exists() else []
    assert kept == taken[len(taken) - len(kept) :]
    assert not folder.exists() or size(folder) <= max_bytes


def test_a_line_cut_by_a_crash_is_ended_first(tmp_path: Path) -> None:
    (tmp_path / NEWER_FILE).write_bytes(b'{"number": 1}\n{"num')
    Journal(tmp_path, 1000).append(b'{"number": 3}')
    assert lines(tmp_path) == [b'{"number": 1}', b'{"num', b'{"number": 3}']


def test_a_failing_disk_loses_lines_and_nothing_else(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    assert not Journal(tmp_path / "file" / "journal", 1000).append(b"{}")
    assert not Journal(tmp_path / "journal", 10).append(b"longer than the bound")


def test_journal_files_are_named_unlike_any_other() -> None:
    """P5: journal, process logs, recordings and exported tables are not confused."""
    assert JOURNAL_FOLDER not in {LOGS, "logs", "credentials"}
    for name in (NEWER_FILE, OLDER_FILE):
        assert not RECORDING.fullmatch(name)
        assert not name.endswith((".log", ".csv", ".mcap"))
