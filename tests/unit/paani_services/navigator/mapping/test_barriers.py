"""What stood in the water is remembered in its place until it is seen to be free, far off, or old."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paani_services.navigator.avoidance.replanning import PlannerState, observe
from paani_services.navigator.mapping.barriers import (
    BARRIER_CELL_M,
    BARRIER_CELLS,
    REMEMBERED_S,
    BarrierMemory,
    barriers_around,
    update_barriers,
)
from paani_services.navigator.mapping.observed_cells import CELL_M
from paani_services.navigator.mapping.occupancy_grid import GRID_CELLS, OccupancyGrid
from tests.synthetic_water import (
    AT_REST,
    PLANNER,
    START_US,
    evidence,
    observe_from,
    odometry,
    open_water,
    water_edge_of,
)

CORNERS = st.tuples(st.integers(-70, 70), st.integers(-70, 70))  # of grids, in cells


def grid_with(corner: tuple[int, int], *places: tuple[int, int]) -> OccupancyGrid:
    """Nothing but water in sight around a corner, with these cells of the frame occupied."""
    cells = np.zeros((GRID_CELLS, GRID_CELLS), np.bool_)
    grid = open_water()._replace(west_m=corner[0] * CELL_M, south_m=corner[1] * CELL_M, free=~cells)
    for column, row in places:
        if 0 <= column - corner[0] < GRID_CELLS and 0 <= row - corner[1] < GRID_CELLS:
            cells[row - corner[1], column - corner[0]] = True
    return grid.with_occupied(cells)


def places_of(memory: BarrierMemory, around_m: tuple[float, float] = (0.0, 0.0)) -> set[tuple[int, int]]:
    """Column and row of each barred cell in the square around a place."""
    barriers = barriers_around(memory, around_m)
    rows, columns = np.nonzero(barriers.is_barred)
    return set(zip((columns + barriers.west).tolist(), (rows + barriers.south).tolist(), strict=True))


@given(corner=CORNERS, place=st.tuples(st.integers(5, 94), st.integers(5, 94)))
def test_what_stands_bars_the_cell_that_it_lies_in(corner: tuple[int, int], place: tuple[int, int]) -> None:
    column, row = corner[0] + place[0], corner[1] + place[1]
    memory = update_barriers(BarrierMemory(), grid_with(corner, (column, row)), START_US)
    middle_m = (corner[0] + GRID_CELLS // 2) * CELL_M, (corner[1] + GRID_CELLS // 2) * CELL_M
    assert places_of(memory, middle_m) == {(column // 2, row // 2)}


@given(first=CORNERS, second=CORNERS)
def test_it_stays_where_it_was_until_it_is_seen_free(first: tuple[int, int], second: tuple[int, int]) -> None:
    """From wherever the boat looks next; what lies off that grid is kept."""
    place = first[0] + 50, first[1] + 50
    memory = update_barriers(BarrierMemory(), grid_with(first, place), START_US)
    free = grid_with(second)
    unseen = free._replace(free=np.zeros_like(free.free))
    kept = update_barriers(memory, unseen, START_US + 1_000_000)
    at_m = place[0] * CELL_M, place[1] * CELL_M
    off = max(abs(place[0] - second[0] - 50), abs(place[1] - second[1] - 50))
    if off < BARRIER_CELLS - 4:
        assert places_of(kept, at_m) == {(place[0] // 2, place[1] // 2)}
    if off < GRID_CELLS // 2 - 2:
        assert places_of(update_barriers(memory, free, START_US + 1_000_000), at_m) == set()
    elif GRID_CELLS // 2 + 2 < off < BARRIER_CELLS - 4:
        assert places_of(update_barriers(memory, free, START_US + 1_000_000), at_m) == places_of(memory, at_m)


@pytest.mark.parametrize("start_us", [START_US, 3_000_000_000_000_000])  # the second of a clock that is wrong
def test_what_is_far_off_or_old_is_forgotten_and_what_is_seen_again_is_not(start_us: int) -> None:
    memory = update_barriers(BarrierMemory(), grid_with((-50, -50), (10, 10)), start_us)
    unseen = grid_with((-50, -50))._replace(free=np.zeros((GRID_CELLS, GRID_CELLS), np.bool_))
    late_us = start_us + round((REMEMBERED_S + 2.0) * 1e6)
    assert places_of(update_barriers(memory, unseen, late_us)) == set()
    again = update_barriers(memory, grid_with((-50, -50), (10, 10)), start_us + 300_000_000)
    assert places_of(update_barriers(again, unseen, late_us)) == {(5, 5)}
    assert len(again.cells) == len(memory.cells)
    away = unseen._replace(west_m=BARRIER_CELLS * BARRIER_CELL_M)
    assert update_barriers(memory, away, start_us + 1_000_000).cells == b""


@pytest.mark.parametrize(("step_us", "epochs", "is_kept"), [(50_000, 0, True), (700_000, 0, False), (50_000, 1, False)])
def test_barriers_go_where_dead_reckoning_begins_anew(step_us: int, epochs: int, is_kept: bool) -> None:
    """After a gap, or another run of the estimator, with a new picture in the same step too."""
    barriers = update_barriers(BarrierMemory(), grid_with((-50, -50), (10, 10)), START_US)
    state, now_us = PlannerState(observe_from(), barriers=barriers), START_US
    for _ in range(30):
        now_us += 50_000
        state = observe(state, odometry(now_us, AT_REST), evidence(now_us, water_edge_of(AT_REST)), PLANNER)
    assert state.barriers == barriers
    now_us += step_us
    here = odometry(now_us, AT_REST)
    here = msgspec.structs.replace(here, epoch=here.epoch + epochs)
    state = observe(state, here, evidence(now_us, water_edge_of(AT_REST)), PLANNER)
    assert state.barriers == (barriers if is_kept else BarrierMemory())


@pytest.mark.parametrize("is_person", [False, True])
def test_whoever_swims_is_no_barrier(is_person: bool) -> None:
    grid = grid_with((-50, -50), (10, 10))
    people = grid.occupied & is_person
    memory = update_barriers(BarrierMemory(), grid._replace(people=people, possible_people=people), START_US)
    assert places_of(memory) == (set() if is_person else {(5, 5)})
