"""What a command writes is whole or absent, and a mistake names the file and the option."""

from __future__ import annotations

from pathlib import Path

import pytest

from paani.errors import UserError
from paani.whole_file import write_whole


def test_a_file_is_replaced_and_nothing_is_left_beside_it(tmp_path: Path) -> None:
    path = tmp_path / "report.json"
    path.write_bytes(b"old")
    write_whole(path, b"new", "--json")
    assert path.read_bytes() == b"new"
    assert list(tmp_path.iterdir()) == [path]


def test_a_folder_that_is_not_there_is_named(tmp_path: Path) -> None:
    path = tmp_path / "none" / "report.json"
    with pytest.raises(UserError, match=f"^--json {path}: No such file"):
        write_whole(path, b"", "--json")
    with pytest.raises(UserError, match=f"^{path}: No such file"):
        write_whole(path, b"")
