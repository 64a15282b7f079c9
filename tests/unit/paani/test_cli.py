"""Commands and services by name."""

from __future__ import annotations

import pytest

from paani.cli import main


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
