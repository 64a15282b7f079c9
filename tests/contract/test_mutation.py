"""What the mutation run counts, and that its list of equivalent mutants is about the code as it is."""

from __future__ import annotations

import json
from pathlib import Path

from tests.mutation.__main__ import PACKAGES
from tests.mutation.verdicts import Equivalent, judge_file, load_equivalents, summary
from tests.places import ROOT

FILE = "boat.py"
MUTANTS = '''
def x_limit__mutmut_orig(speed):
    """The lower of both."""
    return min(speed, 1.0)


def x_limit__mutmut_1(speed):
    """The lower of both."""
    return min(speed, 2.0)


def x_limit__mutmut_2(speed):
    """The lower of both."""
    return min(1.0, speed)
'''
ALIKE = Equivalent(FILE, "limit", "return min(speed, 1.0)", ("return min(1.0, speed)",), "Their order does not matter.")


def judged(folder: Path, codes: tuple[int | None, int | None], *rows: Equivalent) -> tuple[str, bool]:
    (folder / FILE).write_text(MUTANTS)
    names = {f"boat.x_limit__mutmut_{number}": code for number, code in enumerate(codes, 1)}
    (folder / f"{FILE}.meta").write_text(json.dumps({"exit_code_by_key": names}))
    return summary([judge_file(folder, FILE, rows)])


def test_equivalent_and_untried_mutants_are_counted_apart(tmp_path: Path) -> None:
    text, is_enough = judged(tmp_path, (1, 0), ALIKE)
    assert f"{FILE}: 1 of 1, 100.0%, 1 equivalent\n" in text
    assert is_enough
    text, is_enough = judged(tmp_path, (1, None))
    assert f"{FILE}: 1 of 1, 100.0%, 1 not tried\n" in text
    assert is_enough
    assert not judged(tmp_path, (None, None))[1]


def test_a_mutant_without_end_is_noticed_and_counted_apart(tmp_path: Path) -> None:
    text, is_enough = judged(tmp_path, (36, 0), ALIKE)
    assert f"{FILE}: 1 of 1, 100.0%, 1 equivalent, 1 noticed by running out of time\n" in text
    assert is_enough


def test_a_survivor_is_shown_with_its_change_and_counts(tmp_path: Path) -> None:
    text, is_enough = judged(tmp_path, (0, 0), ALIKE)
    assert "boat.x_limit__mutmut_1\n    - return min(speed, 1.0)\n    + return min(speed, 2.0)\n" in text
    assert f"{FILE}: 0 of 1, 0.0%, 1 equivalent\n" in text
    assert not is_enough


def test_a_row_without_a_survivor_fails(tmp_path: Path) -> None:
    text, is_enough = judged(tmp_path, (1, 1), ALIKE)
    assert "equivalent.toml: no such survivor: limit: return min(speed, 1.0)" in text
    assert not is_enough


def test_equivalent_mutants_change_lines_of_the_code_as_it_is() -> None:
    for row in load_equivalents():
        package, _, rest = row.file.partition("/")
        assert row.line in (ROOT / PACKAGES[package] / rest).read_text(encoding="utf-8"), row
        assert row.line not in row.to
