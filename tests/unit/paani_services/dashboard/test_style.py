"""The page's style costs the boat's processor nothing between two messages."""

from __future__ import annotations

import re

from tests.places import ROOT

STATIC = ROOT / "services" / "paani_services" / "dashboard" / "static"
MOVING = re.compile(r"\b(transition|animation|scroll-behavior)\b|@keyframes")


def test_nothing_on_the_page_moves_by_itself() -> None:
    """What moves between two messages has the whole page laid out and painted sixty times a second."""
    found = [path.name for path in STATIC.glob("*.css") if MOVING.search(path.read_text(encoding="utf-8"))]
    assert found == []
