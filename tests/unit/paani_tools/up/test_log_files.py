"""Logs of child processes do not grow without end."""

from __future__ import annotations

from pathlib import Path

from paani_tools.up.log_files import keep_bounded, open_log


def test_a_log_keeps_its_newest_lines_and_is_bounded(tmp_path: Path) -> None:
    path = tmp_path / "plant.log"
    with open_log(path, afresh=True) as child:
        for number in range(1000):
            child.write(b"%06d\n" % number)
            child.flush()
            keep_bounded(path, max_bytes=700)
    older = tmp_path / "plant.log.1"
    assert path.stat().st_size <= 700
    assert older.stat().st_size <= 707
    assert (older.read_bytes() + path.read_bytes()).splitlines()[-101:] == [b"%06d" % n for n in range(899, 1000)]


def test_a_restart_appends_and_a_new_run_begins_afresh(tmp_path: Path) -> None:
    path = tmp_path / "plant.log"
    (tmp_path / "plant.log.1").write_text("of an earlier run")
    for afresh, text in ((True, b"one"), (False, b"two")):
        with open_log(path, afresh=afresh) as child:
            child.write(text)
    assert path.read_bytes() == b"onetwo"
    assert sorted(file.name for file in tmp_path.iterdir()) == ["plant.log"]


def test_a_log_that_is_gone_is_no_error(tmp_path: Path) -> None:
    keep_bounded(tmp_path / "missing.log")
