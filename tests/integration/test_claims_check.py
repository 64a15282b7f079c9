"""`python -m tests.claims_check`: a small product whose tests catch, miss, skip and fail; and a few rows of ours."""

from __future__ import annotations

import random
import subprocess
import sys
from pathlib import Path

import pytest

from tests.claims_check.__main__ import check_rows, main
from tests.claims_check.table import TABLE, read_table
from tests.claims_check.tree import digest_of
from tests.places import ROOT

DRAWN = 5  # rows, two seconds each
HEAVY = ("tests/unit/paani_models/", "tests/unit/mcu/")  # need what not everybody has

pytestmark = [pytest.mark.integration, pytest.mark.timeout(600)]  # every mutant is a process that imports everything

PRODUCT = """
def less() -> bool:
    return 3 < 4


def more() -> bool:
    return 4 > 3
"""
TESTS = """
import pytest
from it import less, more

def test_less() -> None:
    assert less()

@pytest.mark.parametrize("times", [1, 2])
def test_more(times: int) -> None:
    assert more() in (True, False)

@pytest.mark.parametrize("skips", [False, True])
def test_skips(skips: bool) -> None:
    if skips:
        pytest.skip("no engine here")
    assert less()

def test_fails() -> None:
    assert not less()
"""
ROWS = """
[H1]
says = "The test catches it."
test = ["tests/test_it.py::test_more", "tests/test_it.py::test_less"]
mutant = [{ file = "shared/it.py", from = "3 < 4", to = "4 < 3" }]
[H2]
says = "The test misses it."
test = ["tests/test_it.py::test_more"]
mutant = [
    { file = "shared/it.py", from = "4 > 3", to = "3 > 4" },
    { file = "shared/it.py", from = "3 < 4", to = "3 << 4" },
]
[H3]
says = "The test skips, if only once."
test = ["tests/test_it.py::test_skips"]
mutant = [{ file = "shared/it.py", from = "3 < 4", to = "4 < 3" }]
[H4]
says = "The test fails as it is."
test = ["tests/test_it.py::test_fails"]
mutant = [{ file = "shared/it.py", from = "3 < 4", to = "4 < 3" }]
"""


@pytest.fixture
def product(tmp_path: Path) -> Path:
    root = tmp_path / "checkout"
    for folder in ("shared", "tests"):
        (root / folder).mkdir(parents=True)
    (root / "shared" / "it.py").write_text(PRODUCT)
    (root / "tests" / "test_it.py").write_text(TESTS)
    (root / TABLE).write_text(ROWS)
    return root


def test_mutants_are_killed_or_survive_and_a_test_that_does_not_pass_is_named(
    product: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The checkout stays as it is, and a second run takes every verdict from the record."""
    assert main([], product) == 1
    printed = capsys.readouterr().out
    assert "H2: survived: shared/it.py: `4 > 3` -> `3 > 4` (every cited test passes)" in printed
    assert "H2: survived: shared/it.py: `3 < 4` -> `3 << 4` (every cited test passes)" in printed
    assert "H3: error: shared/it.py: `3 < 4` -> `4 < 3` (unbroken: tests/test_it.py::test_skips skipped " in printed
    assert "test_skips skipped no engine here)" in printed
    assert "test_fails failed assert not True" in printed
    assert "H4: error: shared/it.py: `3 < 4` -> `4 < 3` (unbroken: tests/test_it.py::test_fails failed " in printed
    assert printed.splitlines()[-1] == "4 rows, 5 mutants: 1 killed, 2 survived, 2 errors"
    assert (product / "shared" / "it.py").read_text() == PRODUCT
    record = product / "runs" / "claims-check.jsonl"
    assert record.read_text().count('"killed","why":"tests/test_it.py::test_less"') == 1
    before = record.read_bytes()
    assert main(["--rows", "H1"], product) == 0
    assert main(["--rows", "H2"], product) == 1
    assert record.read_bytes() == before


@pytest.mark.rotating(cpu_s=4)
def test_a_changed_product_is_tried_again(product: Path) -> None:
    """And a line of the record that was cut off counts as unknown."""
    assert main(["--rows", "H1"], product) == 0
    record = product / "runs" / "claims-check.jsonl"
    record.write_bytes(record.read_bytes()[:-20])
    assert main(["--rows", "H1"], product) == 0
    (product / "shared" / "it.py").write_text(PRODUCT.replace("return 3 < 4", "return 3 < 4 or True"))
    assert main(["--rows", "H1"], product) == 1


def test_a_few_rows_of_ours_are_killed() -> None:
    """Drawn by the product itself: every change of it draws others. All rows: `python -m tests.claims_check`."""
    table = read_table(ROOT)
    quick = [
        name
        for name, row in table.items()
        if row.mutant and all(test.startswith("tests/unit/") and not test.startswith(HEAVY) for test in row.test)
    ]
    drawn = random.Random(digest_of(ROOT / "shared")).sample(quick, DRAWN)
    verdicts = check_rows({name: table[name] for name in drawn}, ROOT, ROOT / "runs" / "claims-check.jsonl")
    assert [v for v in verdicts if v.state != "killed"] == []


def test_named_tests_run_in_the_order_in_which_they_are_named() -> None:
    """The quick ones first: they kill most mutants, in seconds, before the boat is driven."""
    named = [
        "tests/unit/paani/test_thrust_adapter.py::test_o2_zero_half_a_second_after_the_last_command",
        "tests/fault/test_catalogue.py::test_each_fault_once",
    ]
    words = [sys.executable, "-m", "pytest", "--collect-only", "-q", "-p", "no:cacheprovider", *named]
    collected = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True).stdout.splitlines()
    assert collected[0] == named[0]
    assert collected[1].startswith(named[1])
