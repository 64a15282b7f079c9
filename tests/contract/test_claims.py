"""Every statement of the paper has one row; the tests that a row names exist, and its mutants fit the product."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest

from paani.errors import UserError
from tests.claims_check.__main__ import choose_rows, main
from tests.claims_check.left_out import left_out_text
from tests.claims_check.table import IDS, TABLE, Mutant, Row, find_faults, read_table
from tests.claims_check.tree import Tree
from tests.places import PRODUCT, ROOT

CLAIMS = read_table(ROOT)


def test_the_file_is_complete() -> None:
    assert sum(name[0] < "X" for name in IDS) == 252
    assert [sum(name[0] == letter for name in IDS) for letter in "XYZ"] == [8, 11, 4]
    assert sorted(CLAIMS) == sorted(IDS)


@pytest.mark.slow
def test_every_row_can_be_checked() -> None:
    """Tests that exist, mutants that fit in one place of one file and change its code."""
    assert find_faults(CLAIMS, ROOT) == []


def test_a_statement_is_a_sentence() -> None:
    assert {name: row.says for name, row in CLAIMS.items() if len(row.says.split()) < 4} == {}


def test_every_proved_row_has_a_mutant() -> None:
    assert [name for name, row in CLAIMS.items() if row.test and not row.mutant] == []


def test_every_cited_statement_is_in_the_file() -> None:
    """An id in a docstring or comment, such as (J7) or (I1-I5), is a row of the file."""
    cited = re.compile(r"\b([A-W])(\d{1,2})\b(?:\s?-\s?[A-W]?(\d{1,2})\b)?")
    for folder in PRODUCT:
        for path in (ROOT / folder).rglob("*.py"):
            for bracket in re.findall(r"\(([A-W]\d[^()]{0,60})\)", path.read_text(encoding="utf-8")):
                for letter, first, last in cited.findall(bracket):
                    for number in (first, last or first):
                        assert f"{letter}{int(number)}" in CLAIMS, (path, bracket)


def test_what_a_run_leaves_out_is_one_line_with_the_command() -> None:
    rows = {
        "H1": Row(says="", test=("a.py::test_a",)),
        "H2": Row(says="", test=("a.py::test_a", "b.py::test_b")),
        "H3": Row(says="", test=("c.py::test_c",)),
        "H4": Row(says="", test=("d.py::test_d", "a.py::test_a")),
        "H5": Row(says="", exempt="scope"),
    }
    ran = {"a.py::test_a", "b.py::test_b", "c.py::test_c", "d.py::test_d"}
    assert left_out_text(rows, ran, {}) == ""
    assert left_out_text(rows, ran - {"b.py::test_b"}, {}) == (
        "Left out: 1 of 4 statements whose tests did not all run: H2 (not selected)"
    )
    skipped = {"b.py": "needs the extra paani[train]", "c.py::test_c": "needs root", "d.py::test_d": "needs docker"}
    assert left_out_text(rows, ran, skipped) == (
        "Left out: 3 of 4 statements whose tests did not all run: "
        "H2 (`make test EXTRAS=host,dev,train` runs them), H3 H4 (needs docker; needs root)"
    )


SOUND = """
[H3]
says = "Three is less than four."
test = ["tests/test_it.py::test_three"]
mutant = [{ file = "shared/it.py", from = "3 < 4", to = "3 < 2" }]
"""


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """A checkout with one module, one test and a table that is in order."""
    (tmp_path / "tests").mkdir()
    (tmp_path / "shared").mkdir()
    (tmp_path / "shared" / "it.py").write_text('"""Less is 3 < 5."""\n\n\ndef less() -> bool:\n    return 3 < 4\n')
    (tmp_path / "tests" / "test_it.py").write_text("def test_three() -> None: ...\n")
    (tmp_path / TABLE).write_text(SOUND)
    return tmp_path


@pytest.mark.parametrize(
    ("before", "after", "fault"),
    [
        ("[H3]", "[H33]", "H33: no such statement of the paper"),
        ("::test_three", "::test_four", "H3: no such test: tests/test_it.py::test_four"),
        ("tests/test_it.py", "tests/test_no.py", "H3: no such test: tests/test_no.py::test_three"),
        ("shared/it.py", "shared/no.py", "H3: no such file: shared/no.py"),
        ('from = "3 < 4"', 'from = "3 < 9"', "H3: `from` occurs 0 times in shared/it.py, not once: '3 < 9'"),
        ('from = "3 < 4"', 'from = "3 < "', "H3: `from` occurs 2 times in shared/it.py, not once: '3 < '"),
        ('to = "3 < 2"', 'to = "3 <"', "H3: is no Python any more: shared/it.py: `3 < 4` -> `3 <` (invalid syntax)"),
        ('from = "3 < 4"', 'from = "3 < 5"', "H3: changes no code: shared/it.py: `3 < 5` -> `3 < 2`"),
        ('test = ["tests/test_it.py::test_three"]', "", "H3: needs either `test` or `exempt`"),
        ('says = "', 'exempt = "it is not"\nsays = "', "H3: needs either `test` or `exempt`"),
    ],
)
def test_a_fault_of_the_table_is_named(
    checkout: Path, before: str, after: str, fault: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """With its row, before anything runs, and exit code 2."""
    (checkout / TABLE).write_text(SOUND.replace(before, after))
    assert main([], checkout) == 2
    assert fault in capsys.readouterr().err.splitlines()


def test_a_malformed_table_is_named(checkout: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (checkout / TABLE).write_text(SOUND + "killed = true\n")
    assert main([], checkout) == 2
    assert f"{checkout / TABLE}: Object contains unknown field `killed`" in capsys.readouterr().err


@pytest.mark.parametrize(("name", "is_built"), [("core.cpp", True), ("it.py", False)])
def test_what_a_compiler_reads_is_newer_than_what_was_built(tmp_path: Path, name: str, is_built: bool) -> None:
    """With the mutant and after it, so that `make` builds both; a Python file gets its own time back."""
    source, built = tmp_path / name, tmp_path / "built"
    source.write_text("three = 3")
    os.utime(source, ns=(10**18, 10**18))
    built.touch()
    with Tree(tmp_path).changed_by(Mutant(name, "= 3", "= 4")):
        assert source.read_text() == "three = 4"
        assert (source.stat().st_mtime_ns >= built.stat().st_mtime_ns) is is_built
        built.touch()
    assert source.read_text() == "three = 3"
    assert (source.stat().st_mtime_ns >= built.stat().st_mtime_ns) is is_built


def test_rows_are_chosen_by_id_tier_draw_and_part() -> None:
    mutated = [name for name, row in CLAIMS.items() if row.mutant]
    assert list(choose_rows(CLAIMS, None, None, None, None)) == mutated
    assert list(choose_rows(CLAIMS, ["I7", "H3"], None, None, None)) == ["H3", "I7"]
    parts = [choose_rows(CLAIMS, None, None, None, f"{part}/3") for part in (1, 2, 3)]
    assert sorted(name for part in parts for name in part) == sorted(mutated)
    tenth = choose_rows(CLAIMS, None, None, "1", None)
    assert len(tenth) == -(-len(mutated) // 10)
    assert list(tenth) != list(choose_rows(CLAIMS, None, None, "2", None))
    quick = choose_rows(CLAIMS, None, ["unit"], None, None)
    assert all(test.startswith("tests/unit/") for row in quick.values() for test in row.test)
    for wrong in ("X9", "A11"):
        with pytest.raises(UserError, match=f"--rows: {wrong}"):
            choose_rows(CLAIMS, [wrong], None, None, None)
    for wrong in ("0/3", "4/3", "a"):
        with pytest.raises(UserError, match=f"--shard: {wrong}"):
            choose_rows(CLAIMS, None, None, None, wrong)
