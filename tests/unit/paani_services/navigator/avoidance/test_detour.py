"""The way round what bars the path: it is found where there is one, touches nothing, and ends beyond."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paani_services.navigator.avoidance.detour import REACH_M, find_detour_rad
from paani_services.navigator.guidance.headway import AHEAD_SPACING_M
from paani_services.navigator.mapping.barriers import BARRIER_CELL_M, BARRIER_CELLS, Barriers
from tests.synthetic_water import PLANNER, Bar

STEP_M = 0.8
RADIUS_M = PLANNER.hull_radius_m + PLANNER.tight_margin_m
# A wall across the path with arms towards the boat, and a wall with one arm.
POCKETS: dict[str, tuple[Bar, ...]] = {
    "pocket": ((4.0, -4.0, 5.0, 4.0), (-3.0, 3.0, 5.0, 4.0), (-3.0, -4.0, 5.0, -3.0)),
    "hook": ((4.0, -6.0, 5.0, 4.0), (-3.0, 3.0, 5.0, 4.0)),
    "wall": ((4.0, -6.0, 5.0, 6.0),),
}


def turned(bar: Bar, quarters: int, is_mirrored: bool) -> Bar:
    x = np.array([bar[0], bar[2]]) + 1j * np.array([bar[1], bar[3]])
    x = (x.conj() if is_mirrored else x) * 1j**quarters
    return (float(x.real.min()), float(x.imag.min()), float(x.real.max()), float(x.imag.max()))


def square_around(at_m: complex, bars: list[Bar]) -> Barriers:
    west, south = (math.floor(each / BARRIER_CELL_M) - BARRIER_CELLS // 2 for each in (at_m.real, at_m.imag))
    middle = (np.arange(BARRIER_CELLS) + 0.5) * BARRIER_CELL_M
    east_m, north_m = west * BARRIER_CELL_M + middle[None, :], south * BARRIER_CELL_M + middle[:, None]
    barred = np.zeros((BARRIER_CELLS, BARRIER_CELLS), np.bool_)
    for x0, y0, x1, y1 in bars:
        barred |= (x0 <= east_m) & (east_m <= x1) & (y0 <= north_m) & (north_m <= y1)
    return Barriers(barred, west, south)


def distance_m(at_m: complex, bars: list[Bar]) -> float:
    off = [
        complex(max(x0 - at_m.real, 0.0, at_m.real - x1), max(y0 - at_m.imag, 0.0, at_m.imag - y1))
        for x0, y0, x1, y1 in bars
    ]
    return min(map(abs, off))


@pytest.mark.slow
@settings(max_examples=15, deadline=None)
@given(
    name=st.sampled_from(sorted(POCKETS)),
    quarters=st.integers(0, 3),
    is_mirrored=st.booleans(),
    x_m=st.floats(-2.0, 2.0),
    y_m=st.floats(-1.5, 1.5),
)
def test_a_boat_that_follows_it_comes_out_and_beyond_and_touches_nothing(
    name: str, quarters: int, is_mirrored: bool, x_m: float, y_m: float
) -> None:
    bars = [turned(bar, quarters, is_mirrored) for bar in POCKETS[name]]
    along = 1j**quarters
    at_m, course_rad = complex(x_m, -y_m if is_mirrored else y_m) * along, math.pi / 2.0 * quarters
    for _ in range(80):
        abeam_m = (at_m / along).real
        if abeam_m > 6.5:
            break
        path = [along * (abeam_m + AHEAD_SPACING_M * k) for k in range(round(REACH_M) + 1)]
        detour_rad = find_detour_rad(
            square_around(at_m, bars),
            (at_m.real, at_m.imag),
            course_rad,
            [(each.real, each.imag) for each in path],
            PLANNER,
        )
        heading_rad = course_rad if detour_rad is None else detour_rad
        at_m += STEP_M * complex(math.cos(heading_rad), math.sin(heading_rad))
        assert distance_m(at_m, bars) > RADIUS_M - 1.5 * BARRIER_CELL_M  # what rounding to cells may cost
    assert (at_m / along).real > 6.5


AHEAD = [(AHEAD_SPACING_M * k, 0.0) for k in range(round(REACH_M) + 1)]


@pytest.mark.parametrize("aside_m", [2.0, 5.0])
def test_open_water_needs_none(aside_m: float) -> None:
    beside = square_around(0j, [(-5.0, aside_m, 12.0, aside_m + 1.0)])
    assert find_detour_rad(beside, (0.1, 0.1), 0.0, AHEAD, PLANNER) is None
    abeam = [(x_m, y_m - 3.0) for x_m, y_m in AHEAD]  # the line of sight leads back to it, ahead
    assert find_detour_rad(beside, (0.1, 0.1), 0.0, abeam, PLANNER) is None


@pytest.mark.parametrize("course_deg", [0.0, 45.0, 180.0])
def test_a_camera_that_sees_beyond_the_square_needs_no_more_of_it(course_deg: float) -> None:
    far = msgspec.structs.replace(PLANNER, max_range_m=60.0)
    assert find_detour_rad(square_around(0j, []), (0.1, 0.1), math.radians(course_deg), AHEAD, far) is None


def test_a_boat_walled_in_is_led_nowhere() -> None:
    walls = [(4.0, -5.0, 5.0, 5.0), (-5.0, -5.0, -4.0, 5.0), (-5.0, 4.0, 5.0, 5.0), (-5.0, -5.0, 5.0, -4.0)]
    assert find_detour_rad(square_around(0j, walls), (0.1, 0.1), 0.0, AHEAD, PLANNER) is None


@pytest.mark.parametrize("gap_m", [1.2, 2.6])
def test_a_gap_counts_as_a_way_where_hull_and_margin_fit(gap_m: float) -> None:
    """Through it, or round the whole wall: 20 m."""
    wall = [
        (4.0, 0.5 * gap_m, 5.0, 9.0),
        (4.0, -9.0, 5.0, -0.5 * gap_m),
        (-9.0, 8.0, 5.0, 9.0),
        (-9.0, -9.0, 5.0, -8.0),
    ]
    detour_rad = find_detour_rad(square_around(0j, wall), (0.1, 0.1), 0.0, AHEAD, PLANNER)
    if gap_m < 2.0 * RADIUS_M:
        assert detour_rad is not None
        assert math.cos(detour_rad) < 0.0
    else:
        assert detour_rad is None


@pytest.mark.parametrize("is_mirrored", [False, True])
def test_of_two_gaps_the_nearer_is_taken(is_mirrored: bool) -> None:
    """Both within 45 degrees of the course: a way is as long as it is, not as its longer side."""
    walls = [(6.0, 3.6, 7.0, 20.0), (6.0, -4.6, 7.0, 1.4), (6.0, -20.0, 7.0, -6.8)]
    bars = [turned(bar, 0, is_mirrored) for bar in walls]
    detour_rad = find_detour_rad(square_around(0j, bars), (0.2, 0.2), 0.0, AHEAD, PLANNER)
    assert detour_rad is not None
    assert (detour_rad < 0.0) is is_mirrored


def test_what_bars_the_path_farther_off_than_the_camera_sees_is_gone_round_too() -> None:
    """A boat that was there remembers it."""
    wall = square_around(0j, [(PLANNER.max_range_m + 4.0, -6.0, PLANNER.max_range_m + 5.0, 3.0)])
    detour_rad = find_detour_rad(wall, (0.1, 0.1), 0.0, AHEAD, PLANNER)
    assert detour_rad is not None
    assert 0.0 < detour_rad < math.pi / 2.0


def test_a_path_that_comes_back_beside_the_boat_is_not_cut_short() -> None:
    """It is rejoined beyond what bars it first, not where it comes by again."""
    there = [*((float(k), 0.0) for k in range(10)), *((9.0, float(k)) for k in range(1, 3))]
    back = [(9.0 - k, 3.0) for k in range(10)]
    wall = square_around(0j, [(4.0, -3.5, 5.0, 6.0)])
    detour_rad = find_detour_rad(wall, (0.1, 0.1), 0.0, [*there, *back], PLANNER)
    assert detour_rad is not None
    assert -math.pi / 2.0 < detour_rad < 0.0
