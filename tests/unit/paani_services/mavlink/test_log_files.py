"""Which recordings a ground station may have, and what is read of them."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from paani.logs.folder import start_us
from paani_services.mavlink.log_files import list_logs, read_log
from tests.unit.paani.logs.small_logs import NAME, START_US, begin, fill, finished

LATER = "20231114T221330Z-2.mcap"


@pytest.mark.slow
def test_the_recordings_of_the_folder_but_the_one_that_is_written(tmp_path: Path) -> None:
    written = finished(tmp_path)
    (tmp_path / "notes.mcap").write_bytes(b"not a recording of ours")
    (tmp_path / "20231114T221332Z-1.mcap").symlink_to(written)
    (tmp_path / "20231114T221333Z-1.mcap").touch()
    (tmp_path / "99999999T221334Z-1.mcap").write_bytes(b"no time")
    log = begin(tmp_path, LATER)
    fill(log, 20, 10)
    found = list_logs(str(tmp_path))
    assert [(file.path.name, file.start_us) for file in found] == [
        (NAME, START_US // 1_000_000 * 1_000_000),
        ("99999999T221334Z-1.mcap", 0),
    ]
    assert found[0].size_bytes == written.stat().st_size
    log.finish({})
    assert LATER in [file.path.name for file in list_logs(str(tmp_path))]


@pytest.mark.parametrize("folder", ["", "absent"])
def test_where_nothing_is_recorded_there_is_nothing(folder: str, tmp_path: Path) -> None:
    assert list_logs(folder and str(tmp_path / folder)) == ()


def test_bytes_of_a_file_of_the_folder_and_of_nothing_else(tmp_path: Path) -> None:
    path, secret = tmp_path / NAME, tmp_path / "secret"
    path.write_bytes(bytes(range(100)))
    secret.write_bytes(b"secret")
    assert read_log(path, 10, 20) == bytes(range(10, 30))
    assert read_log(path, 90, 20) == bytes(range(90, 100))
    assert read_log(path, 200, 20) == b""
    path.unlink()
    assert read_log(path, 0, 20) == b""
    path.symlink_to(secret)  # put there after the list was made
    assert read_log(path, 0, 20) == b""
    path.unlink()
    os.mkfifo(path)
    assert read_log(path, 0, 20) == b""


def test_the_time_of_a_name() -> None:
    assert start_us("20231114T221320Z-1.mcap") == 1_700_000_000_000_000
    assert start_us("20231114T226000Z-1.mcap") == 0
