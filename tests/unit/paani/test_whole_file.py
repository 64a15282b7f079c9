"""What a command writes is whole or absent, and a mistake names the file and the option."""

from __future__ import annotations

import contextlib
import errno
import os
from pathlib import Path

import pytest

from paani.errors import UserError
from paani.whole_file import indented_json, new_folder, replacement_file, write_json, write_whole


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


def test_what_goes_wrong_leaves_the_file_as_it_was(tmp_path: Path) -> None:
    path = tmp_path / "net.onnx"
    path.write_bytes(b"old")
    with contextlib.suppress(KeyboardInterrupt), replacement_file(path) as beside:
        beside.write_bytes(b"half")
        raise KeyboardInterrupt
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_full_disk_is_named_with_the_option(tmp_path: Path) -> None:
    with (
        pytest.raises(UserError, match=f"^--out {tmp_path / 'a'}: No space left on device$"),
        replacement_file(tmp_path / "a", "--out"),
    ):
        raise OSError(errno.ENOSPC, "No space left on device")


def test_a_report_is_readable_and_ends_its_line(tmp_path: Path) -> None:
    write_json(tmp_path / "report.json", {"rows": [1]})
    assert (tmp_path / "report.json").read_bytes() == b'{\n "rows": [\n  1\n ]\n}\n' == indented_json({"rows": [1]})


def test_a_folder_is_whole_or_absent(tmp_path: Path) -> None:
    path = tmp_path / "sets" / "new"
    with contextlib.suppress(KeyboardInterrupt), new_folder(path) as beside:
        (beside / "a").touch()
        raise KeyboardInterrupt
    assert list(path.parent.iterdir()) == []
    with new_folder(path) as beside:
        (beside / "b").touch()
    assert [each.name for each in path.iterdir()] == ["b"]
    assert list(path.parent.iterdir()) == [path]


def test_a_folder_that_exists_is_not_written_into(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=f"^--csv {tmp_path}: already exists$"), new_folder(tmp_path, "--csv"):
        pass


def test_a_link_stays_one_and_a_pipe_is_written_to_as_it_is(tmp_path: Path) -> None:
    target, link, pipe = tmp_path / "target", tmp_path / "link", tmp_path / "pipe"
    target.write_bytes(b"old")
    link.symlink_to(target)
    write_whole(link, b"new")
    assert (link.is_symlink(), target.read_bytes()) == (True, b"new")
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    try:
        write_whole(pipe, b"new")
        assert (pipe.is_fifo(), os.read(reader, 8)) == (True, b"new")
    finally:
        os.close(reader)
