"""A leg over what the boat has seen is marked where it meets it, in the engine that checks it."""

from __future__ import annotations

import base64
from typing import Any

import pytest

from paani import messages as m

pytestmark = [pytest.mark.browser, pytest.mark.timeout(60)]

MARKS = """async ([waypoints, grid]) => {
  const { findMarks } = await import("/static/mission_checks.js");
  const legs = [{ kind: "follow_route", waypoints, repeat: false, laps: 1 }];
  return findMarks({ legs, fence: [], rally: [] }, { marginM: 0, turnRadiusM: 0 }, grid)
    .map(({ at, text }) => [at.x_m, at.y_m, text]);
}"""
COLUMNS, ROWS, CELL_M = 6, 4, 2.0
WEST_M, SOUTH_M = -4.0, 10.0


def grid_with(column: int, row: int, what: m.Occupancy) -> dict[str, Any]:
    """Free water but for one cell, as the navigator's messages have it on the page."""
    cells = [int(m.Occupancy.FREE)] * (COLUMNS * ROWS)
    cells[row * COLUMNS + column] = int(what)
    packed = bytes(
        sum(cell << (2 * place) for place, cell in enumerate(cells[i : i + 4])) for i in range(0, len(cells), 4)
    )
    return {
        "west_m": WEST_M, "south_m": SOUTH_M, "cell_m": CELL_M, "columns": COLUMNS, "rows": ROWS,
        "cells": base64.b64encode(packed).decode(),
    }  # fmt: skip


async def test_a_leg_over_an_occupied_cell_is_marked_there(scripts_page: Any) -> None:
    for column, row in ((0, 0), (3, 1), (5, 3)):
        x_m, y_m = WEST_M + CELL_M * (column + 0.5), SOUTH_M + CELL_M * (row + 0.5)
        over = [{"x_m": x_m - 20.0, "y_m": y_m}, {"x_m": x_m + 20.0, "y_m": y_m}]
        beside = [{"x_m": each["x_m"], "y_m": each["y_m"] + CELL_M} for each in over]
        occupied = grid_with(column, row, m.Occupancy.OCCUPIED)
        ((at_x_m, at_y_m, text),) = await scripts_page.evaluate(MARKS, [over, occupied])
        assert text == "leg 1, waypoint 1: the boat has seen something there"
        assert (abs(at_x_m - x_m) <= CELL_M / 2, at_y_m) == (True, pytest.approx(y_m))
        assert await scripts_page.evaluate(MARKS, [beside, occupied]) == []
        assert await scripts_page.evaluate(MARKS, [over, grid_with(column, row, m.Occupancy.UNKNOWN)]) == []
