"""Tests that take turns: a run has one part of them, every test has its turn, and no proof is among them."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.claims_check.table import read_table
from tests.places import ROOT
from tests.rotation import draw, share_out

PAGES = ("docs/safety.md", "docs/concepts/threat-model.md")
TESTS = """
import pytest

@pytest.mark.rotating(cpu_s=30)
@pytest.mark.parametrize("case", [1, 2])
def test_long(case): ...

@pytest.mark.rotating(cpu_s=20)
def test_shorter(): ...

@pytest.mark.rotating(cpu_s=10)
def test_shortest(): ...

def test_always(): ...
"""


def is_rotating(node: ast.AST) -> bool:
    return isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and any(
        ast.unparse(each).startswith("pytest.mark.rotating(cpu_s=") for each in node.decorator_list
    )


def test_no_test_that_proves_something_takes_turns() -> None:
    """A statement of the paper, a hazard's safeguard and a threat's answer are tested in every run."""
    rotating = {
        f"{path.relative_to(ROOT)}::{node.name}"
        for path in (ROOT / "tests").rglob("test_*.py")
        if "mark.rotating(" in (text := path.read_text(encoding="utf-8"))
        for node in ast.parse(text).body
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and is_rotating(node)
    }
    assert len(rotating) >= 30
    proofs = {test for row in read_table(ROOT).values() for test in row.test}
    for page in PAGES:
        proofs |= set(re.findall(r"tests/[\w/]+\.py::\w+", (ROOT / page).read_text(encoding="utf-8")))
    assert rotating & proofs == set()


@given(cpu_s=st.dictionaries(st.text(), st.floats(1.0, 300.0), min_size=1), count=st.integers(1, 6))
def test_parts_take_about_the_same_time(cpu_s: dict[str, float], count: int) -> None:
    parts = share_out(cpu_s, count)
    assert parts.keys() == cpu_s.keys()
    assert share_out(dict(sorted(cpu_s.items(), reverse=True)), count) == parts
    loads_s = [sum(cpu_s[name] for name, part in parts.items() if part == each) for each in range(count)]
    assert sum(loads_s) == pytest.approx(sum(cpu_s.values()))
    assert max(loads_s) - min(loads_s) <= max(cpu_s.values()) + 1e-9


def test_each_part_has_its_turn() -> None:
    assert {draw(f"{commit:040x}", 3) for commit in range(10**20, 10**20 + 3)} == {0, 1, 2}
    assert draw("", 3) == 0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("parts", "passed", "skipped"),
    [(1, ["test_always", "test_long", "test_shorter", "test_shortest"], 0), (2, ["test_always", "test_long"], 2)],
)
def test_what_has_no_turn_skips_and_says_so(tmp_path: Path, parts: int, passed: list[str], skipped: int) -> None:
    """All cases of a test have their turn together; a folder that is no checkout draws the first part."""
    (tmp_path / "test_it.py").write_text(TESTS)
    (tmp_path / "pytest.ini").write_text(f"[pytest]\npythonpath = {ROOT}\n")
    words = [sys.executable, "-m", "pytest", "-v", "-rs", "-p", "tests.rotation", f"--parts={parts}", str(tmp_path)]
    text = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert sorted(set(re.findall(r"::(\w+)\S* PASSED", text))) == passed
    assert text.count("of 2, which this commit draws (`make test PARTS=1`)") == skipped


@pytest.mark.slow
def test_no_parts_are_refused() -> None:
    words = [sys.executable, "-m", "pytest", "--co", "--parts=0", __file__]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr.strip().splitlines()[-1]) == (4, "ERROR: --parts: not 1 or more")
