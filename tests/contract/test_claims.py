"""Every statement of the paper has one row, and every test that a row names exists."""

from __future__ import annotations

import ast
import re
import tomllib

import pytest

from tests.places import ROOT

COUNTS = {
    "A": 12, "B": 17, "C": 15, "D": 11, "E": 7, "F": 4, "G": 11, "H": 6, "I": 22, "J": 19, "K": 10, "L": 5, "M": 11,
    "N": 8, "O": 5, "P": 5, "Q": 6, "R": 11, "S": 12, "T": 6, "U": 10, "V": 24, "W": 15,
}  # fmt: skip
CLAIMS = tomllib.loads((ROOT / "tests" / "claims.toml").read_text(encoding="utf-8"))


def test_the_file_is_complete() -> None:
    expected = [f"{letter}{number}" for letter, count in COUNTS.items() for number in range(1, count + 1)]
    assert len(expected) == 252
    assert sorted(CLAIMS) == sorted(expected)


@pytest.mark.parametrize("claim", CLAIMS)
def test_a_row_is_proved_exempt_or_pending(claim: str) -> None:
    row = CLAIMS[claim]
    assert len(row.keys() & {"test", "exempt", "pending"}) == 1
    assert row.keys() <= {"says", "test", "exempt", "pending"}
    assert len(row["says"].split()) >= 4, "a statement is a sentence"
    for name in row.get("test", []):
        file, _, function = name.partition("::")
        assert (ROOT / file).is_file(), name
        tree = ast.parse((ROOT / file).read_text(encoding="utf-8"))
        functions = {n.name for n in ast.walk(tree) if isinstance(n, ast.FunctionDef | ast.AsyncFunctionDef)}
        assert function in functions, name
    assert row.get("test", True), "an empty list of tests proves nothing"


def test_every_cited_statement_is_in_the_file() -> None:
    """An id in a docstring or comment, such as (J7) or (I1-I5), is a row of the file."""
    cited = re.compile(r"\b([A-W])(\d{1,2})\b(?:\s?-\s?[A-W]?(\d{1,2})\b)?")
    for folder in ("shared", "services", "sim_host", "models"):
        for path in (ROOT / folder).rglob("*.py"):
            for bracket in re.findall(r"\(([A-W]\d[^()]{0,60})\)", path.read_text(encoding="utf-8")):
                for letter, first, last in cited.findall(bracket):
                    for number in (first, last or first):
                        assert f"{letter}{int(number)}" in CLAIMS, (path, bracket)
