"""Vessels out of sight: one that is adrift too slowly to be told from moored comes nearer while it is passed."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from paani.messages import Label
from paani_services.navigator.grid import Grid, lay
from paani_services.navigator.planner import clearance_m
from paani_services.navigator.shown import CELL_M
from paani_services.navigator.sighting import Memory
from paani_sim.eye.camera import BoatPose
from tests.unit.watery_sights import AT_REST, CAMERA, PLANNER, Bar, box_over, edge_of, looked_away, seen

HULL: Bar = (4.0, -1.0, 5.0, 1.0)


def passed(seconds: float, label: Label = Label.VESSEL) -> tuple[Memory, int]:
    """Of a boat that saw this ahead, and has looked astern since."""
    return looked_away(seconds, box_over(HULL, 0.8, label), edge_of(AT_REST, (HULL,)))


def off_m(grid: Grid) -> float:
    """How far ahead of the boat the nearest of it is."""
    clear_m = clearance_m(grid, PLANNER)
    row = int(-grid.south_m / CELL_M)
    columns = np.flatnonzero(clear_m[row] <= 0.0)
    return float(grid.west_m + CELL_M * (columns.min() + 0.5))


@pytest.mark.parametrize(("seconds", "nearer_m"), [(0.8, 0.0), (3.2, 0.48), (6.4, 0.96), (16.0, 1.2)])
def test_a_vessel_out_of_sight_drifts(seconds: float, nearer_m: float) -> None:
    """0.15 m/s (Q6), 1.2 m at most; in trials one at 0.08 m/s came up 0.06 m short of the boat that passed it."""
    memory, now_us = passed(seconds)
    grid = lay(memory.sights, (0.0, 0.0), now_us, CAMERA, PLANNER)
    assert off_m(grid) == pytest.approx(4.0 - nearer_m, abs=1.5 * CELL_M)
    still = msgspec.structs.replace(PLANNER, vessel_reach_m=0.0)
    assert not lay(memory.sights, (0.0, 0.0), now_us, CAMERA, still).strayed.any()


@pytest.mark.parametrize("label", [Label.PIER, Label.BUOY])
def test_what_is_made_fast_drifts_no_further_than_all_that_is_hidden(label: Label) -> None:
    memory, now_us = passed(16.0, label)
    grid = lay(memory.sights, (0.0, 0.0), now_us, CAMERA, PLANNER)
    assert not grid.strayed.any()
    assert off_m(grid) == pytest.approx(4.0 - PLANNER.hidden_drift_m, abs=1.5 * CELL_M)


def test_it_has_not_drifted_to_where_a_picture_shows_water() -> None:
    memory, now_us = passed(12.0)
    memory = seen(BoatPose(0.0, 0.0, 0.7), at_us=now_us + 200_000, memory=memory)
    grid = lay(memory.sights, (0.0, 0.0), now_us + 200_000, CAMERA, PLANNER)
    assert grid.strayed.any()
    assert not (grid.strayed & grid.free).any()
