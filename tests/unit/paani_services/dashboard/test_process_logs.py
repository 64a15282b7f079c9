"""The last lines of a log: whole ones, bounded, whatever the bytes."""

from __future__ import annotations

from pathlib import Path

import pytest

from paani_services.dashboard.process_logs import MAX_BYTES, MAX_LINES, read_last_lines


def test_a_short_log_is_whole(tmp_path: Path) -> None:
    path = tmp_path / "advisor.log"
    path.write_bytes(b"first\nsecond \xff\n")
    found = read_last_lines(path)
    assert (found.lines, found.cut) == (("first", "second \ufffd"), False)


@pytest.mark.parametrize("line", [b"x\n", b"y" * 500 + b"\n"])
def test_a_long_log_ends_with_its_last_whole_lines(tmp_path: Path, line: bytes) -> None:
    path = tmp_path / "advisor.log"
    path.write_bytes(line * 20_000 + b"last\n")
    found = read_last_lines(path)
    assert found.cut
    assert found.lines[-1] == "last"
    assert found.lines[0] == line.decode().rstrip(), "no line is cut in two"
    assert len(found.lines) <= MAX_LINES
    assert sum(map(len, found.lines)) <= MAX_BYTES
