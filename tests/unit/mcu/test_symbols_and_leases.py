"""The lights of every direction, row by row, and how long guidance lasts that states a lease of its own (O3, O4)."""

from __future__ import annotations

import re

import pytest

from paani.messages import Direction, McuState
from tests.places import ROOT
from tests.unit.mcu.core import Core, guide

ARROWS = {
    Direction.STRAIGHT: "0001000 0011100 0111110 1101011 0001000 0001000 0001000 0001000",
    Direction.SLIGHT_LEFT: "1111000 1110000 1111000 1011100 0001110 0000111 0000011 0000000",
}


@pytest.mark.parametrize("direction", ARROWS)
def test_o3_an_arrow_points_where_it_says(direction: Direction) -> None:
    core = Core()
    try:
        core.call(guide(1, direction))
        core.wait(1)
        assert [row[:7].replace("7", "1") for row in core.lights()] == ARROWS[direction].split()
    finally:
        core.close()


def test_o4_in_the_paper_guidance_is_stale_a_second_after_the_last_whatever_its_lease() -> None:
    core = Core(paper=True)
    try:
        core.call(guide(1, lease_ms=3600))
        core.wait(600)
        core.call(guide(2, lease_ms=3600))
        states = []
        for wait_ms in (999, 1):
            core.wait(wait_ms)
            states.append(core.status().state)
        assert states == [McuState.FRESH, McuState.STALE]
    finally:
        core.close()


def test_o4_the_sketch_begins_armed_against_silence_unless_it_is_the_papers() -> None:
    text = (ROOT / "mcu/app/sketch/sketch.ino").read_text(encoding="utf-8")
    choice = (
        r"#if[^\n]*PAPER[^\n]*\n[^\n]*SETTING = paani::PAPER_SETTING;\n#else\n[^\n]*SETTING = paani::PAANI_SETTING;"
    )
    assert re.search(choice, text)
