"""`paani claims` lists every statement with its proof."""

from __future__ import annotations

import tomllib

import msgspec
import pytest

from paani import cli
from tests.places import ROOT

ROWS = tomllib.loads((ROOT / "tests" / "claims.toml").read_text(encoding="utf-8"))


@pytest.mark.slow
def test_every_statement_is_listed_with_its_proof(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["claims", "--json"]) == 0
    listed = msgspec.json.decode(capsys.readouterr().out)
    assert [each["id"] for each in listed] == list(ROWS)
    for each in listed:
        row = ROWS[each["id"]]
        assert each["says"] == row["says"]
        assert each["proof"] == row.get("test", [row.get("exempt")])
        assert each["improved"] == row.get("improved", "")
        assert each["state"] == ("exempt" if "exempt" in row else "improved" if "improved" in row else "proved")


@pytest.mark.parametrize(
    ("words", "ids"),
    [
        (["J7"], ["J7"]),
        (["j5-j7", "O4"], ["J5", "J6", "J7", "O4"]),
        (["J5-J9999"], [f"J{number}" for number in range(5, 20)]),
        (["N"], [f"N{number}" for number in range(1, 9)]),
        (["O", "--find", "1,000 ms", "--state", "exempt", "proved"], ["O4"]),
    ],
)
@pytest.mark.slow
def test_statements_are_chosen_by_id_words_and_state(
    words: list[str], ids: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["claims", *words]) == 0
    printed = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in printed if not line.startswith(" ")][:-1] == ids
    assert printed[-1].startswith(f"{len(ids)} statement")


@pytest.mark.parametrize("name", ["X9", "J99", "J7-K2", "7", f"J1-J{'9' * 5000}"])
@pytest.mark.slow
def test_an_unknown_id_is_refused(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["claims", name]) == 2
    assert f"{name[-20:]}: no such statement" in capsys.readouterr().err
