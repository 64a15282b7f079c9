"""The safety case and the threat model name tests that exist, and no hazard is left without a safeguard."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.places import ROOT

SAFETY_CASE = ROOT / "docs" / "safety.md"
CITED = re.compile(r"`(tests/[\w/]+\.py)::(test_\w+)`")


def rows_of(path: Path, heading: str) -> list[list[str]]:
    """Cells of the table below this heading, without its head."""
    section = path.read_text(encoding="utf-8").split(f"\n## {heading}\n")[1].split("\n## ")[0]
    rows = [line.strip("|").split("|") for line in section.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in row] for row in rows[2:]]


@pytest.mark.parametrize("page", ["docs/safety.md", "docs/concepts/threat-model.md"])
def test_every_cited_test_is_there(page: str) -> None:
    cited = CITED.findall((ROOT / page).read_text(encoding="utf-8"))
    assert len(cited) >= 15
    for file, name in cited:
        assert f"def {name}(" in (ROOT / file).read_text(encoding="utf-8"), f"{page}: {file}::{name}"


def test_every_unsafe_action_has_a_hazard_and_a_test() -> None:
    hazards = {row[0] for row in rows_of(SAFETY_CASE, "Hazards")}
    actions = rows_of(SAFETY_CASE, "Unsafe control actions")
    assert [row[0].split()[0] for row in actions] == [f"U{number}" for number in range(1, len(actions) + 1)]
    for row in actions:
        assert set(row[2].split(", ")) <= hazards, row[0]
        assert CITED.search(row[4]), row[0]


def test_no_hazard_is_without_a_loss_or_an_action() -> None:
    losses = {row[0] for row in rows_of(SAFETY_CASE, "Losses")}
    hazards = {row[0]: set(row[2].split(", ")) for row in rows_of(SAFETY_CASE, "Hazards")}
    assert set().union(*hazards.values()) == losses
    met = {hazard for row in rows_of(SAFETY_CASE, "Unsafe control actions") for hazard in row[2].split(", ")}
    assert met == set(hazards)
