"""`paani bench board`: an address and a process that cannot be are told before anything is polled."""

from __future__ import annotations

import pytest

from paani_tools.bench.board.command import main


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--attach", "http://127.0.0.1:99999"], "argument --attach: 'http://127.0.0.1:99999': expected an address"),
        (["--attach", "http://127.0.0.1:0"], "argument --attach: 'http://127.0.0.1:0': expected an address"),
        (["--attach", "ftp://127.0.0.1"], "argument --attach: 'ftp://127.0.0.1': expected an address"),
        (["--cgroup-of", "self"], "argument --cgroup-of: 'self' is no whole number"),
    ],
)
def test_what_cannot_be_polled_is_refused(words: list[str], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        main(words)
    assert stop.value.code == 2
    assert message in capsys.readouterr().err
