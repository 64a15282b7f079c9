"""What a range scanner adds to the map of the water."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from paani_services.navigator.mapping.observation import ObservationMemory
from paani_services.navigator.mapping.observed_cells import CELL_M
from paani_services.navigator.mapping.occupancy_grid import OccupancyGrid
from paani_services.navigator.mapping.range_scans import find_echoes
from paani_services.navigator.mapping.scanned_obstacles import ScannedWater, scan_water
from paani_services.navigator.mapping.water_map import map_water
from paani_sim.eye.camera import BoatPose
from tests.synthetic_scans import MAX_RANGE_M, SCAN_US, scan_from
from tests.synthetic_water import (
    AT_REST,
    CAMERA,
    PLANNER,
    START_US,
    Bar,
    distance_to_bar_m,
    observe_from,
    water_edge_of,
)

SCANS = 14
SHARE = st.floats(0.0, 1.0)
BANKS = ((-60.0, 6.0, 60.0, 7.0), (-60.0, -5.0, 60.0, -4.0))
MOORED = tuple((x_m, -3.8, x_m + 6.0, -2.0) for x_m in (-16.0, -8.5, 0.0, 8.5, 16.0))


def moved(bar: Bar, east_m: float, north_m: float) -> Bar:
    return (bar[0] + east_m, bar[1] + north_m, bar[2] + east_m, bar[3] + north_m)


def scanned(
    hull: Bar | None,
    velocity_mps: tuple[float, float] = (0.0, 0.0),
    boat_mps: float = 0.0,
    standing: tuple[Bar, ...] = (),
    yaw_rate_radps: float = 0.0,
) -> tuple[ObservationMemory, int]:
    """The memory after `SCANS` turns, at the end of which the hull is where it is given, and the time by then."""
    memory = ObservationMemory()
    for number in range(SCANS):
        ago_s = (SCANS - 1 - number) * SCAN_US * 1e-6
        boat = BoatPose(-ago_s * boat_mps, 0.0, -ago_s * yaw_rate_radps)
        hulls = () if hull is None else (moved(hull, -ago_s * velocity_mps[0], -ago_s * velocity_mps[1]),)
        memory = scan_from(START_US + number * SCAN_US, boat, (*standing, *hulls), memory)
    return memory, START_US + (SCANS - 1) * SCAN_US


def water_of(memory: ObservationMemory, now_us: int) -> ScannedWater:
    water = scan_water(memory.scans, now_us, PLANNER)
    assert water is not None
    return water


@given(st.floats(0.0, 0.8), st.floats(-0.35, 0.35))
@settings(max_examples=25, deadline=None)
@pytest.mark.slow
def test_banks_and_moored_rows_do_not_move_past_a_boat_that_does(boat_mps: float, yaw_rate_radps: float) -> None:
    """Ever more of them comes into sight; not one echo is left out of the map for that."""
    memory, now_us = scanned(None, boat_mps=boat_mps, standing=(*BANKS, *MOORED), yaw_rate_radps=yaw_rate_radps)
    water = water_of(memory, now_us)
    assert water.obstacles == ()
    assert water.standing.tolist() == np.flatnonzero(water.scan.ranges_m).tolist()


@given(st.floats(-math.pi, math.pi), st.floats(0.75, 2.5), SHARE, SHARE, st.sampled_from([-1.0, 1.0]))
@example(1.15625, 1.15625, 0.1875, 0.0, 1.0)  # one echo of its other side stands apart in four scans
@settings(max_examples=40, deadline=None)
@pytest.mark.slow
def test_the_velocity_of_what_comes_is_known_all_round(
    bearing_rad: float, speed_mps: float, range_share: float, closing_share: float, side: float
) -> None:
    """A hull of 2 m x 2 m in sight for 2.6 s that comes nearer by its whole length, from any side."""
    range_m = 4.0 + range_share * (min(12.0, 0.85 * MAX_RANGE_M - 2.6 * speed_mps) - 4.0)
    closing_mps = 0.7 + closing_share * (speed_mps - 0.7)
    course_rad = bearing_rad + math.pi + side * math.acos(closing_mps / speed_mps)
    place = (range_m * math.cos(bearing_rad), range_m * math.sin(bearing_rad))
    velocity_mps = (speed_mps * math.cos(course_rad), speed_mps * math.sin(course_rad))
    memory, now_us = scanned((place[0] - 1.0, place[1] - 1.0, place[0] + 1.0, place[1] + 1.0), velocity_mps)
    [found] = water_of(memory, now_us).obstacles
    assert math.dist(found.velocity[:2], velocity_mps) < 0.3 + 0.3 * speed_mps
    assert found.is_moving


@pytest.mark.parametrize("bow_m", [-12.0, -6.0, -1.0])
def test_a_long_hull_that_overtakes_close_by_is_known_by_its_nearer_end(bow_m: float) -> None:
    """14 m, 2 m aside: ever more of its side comes into sight, and of it the middle moves otherwise."""
    memory, now_us = scanned((bow_m - 14.0, 2.0, bow_m, 4.4), (2.0, 0.0), boat_mps=0.5)
    [found] = water_of(memory, now_us).obstacles
    assert found.velocity[:2] == pytest.approx((2.0, 0.0), abs=0.35)


def test_what_moves_is_where_it_will_be_and_off_the_grid() -> None:
    hull = (-8.0, -1.0, -6.0, 1.0)
    memory, now_us = scanned(hull, (1.0, 0.0), standing=BANKS)
    memory = observe_from(memory=memory, at_us=now_us)
    later_us = now_us + 300_000
    grid, obstacles = map_water(memory.observations, (0.0, 0.0), later_us, CAMERA, PLANNER, memory.scans)
    [found] = obstacles
    assert found.east_m.max() == pytest.approx(-5.7, abs=0.15)
    assert found.age_s == pytest.approx(0.3)
    assert not is_occupied(grid, hull)
    assert is_occupied(grid, BANKS[0])


def is_occupied(grid: OccupancyGrid, bar: Bar) -> bool:
    rows, columns = np.nonzero(grid.occupied)
    middles = zip(
        (grid.west_m + (columns + 0.5) * CELL_M).tolist(), (grid.south_m + (rows + 0.5) * CELL_M).tolist(), strict=True
    )
    return any(distance_to_bar_m(x_m, y_m, bar) < CELL_M for x_m, y_m in middles)


def test_what_stands_is_occupied_where_the_camera_does_not_see_it() -> None:
    """Astern, abeam, in the blind zone, which counts as water without it, and where the camera took it for water."""
    bars = ((-4.0, -0.5, -3.0, 0.5), (-0.5, 1.4, 0.5, 2.0), (4.0, -0.5, 4.6, 0.5))
    memory, now_us = scanned(None, standing=bars)
    memory = observe_from(memory=memory, at_us=now_us)
    without, _ = map_water(memory.observations, (0.0, 0.0), now_us, CAMERA, PLANNER)
    grid, obstacles = map_water(memory.observations, (0.0, 0.0), now_us, CAMERA, PLANNER, memory.scans)
    assert obstacles == ()
    for bar in bars:
        assert is_occupied(grid, bar)
        assert not is_occupied(without, bar)
    assert not (grid.occupied & (grid.free | grid.blind_zone)).any()


@given(st.lists(st.tuples(st.floats(-9.0, 9.0), st.floats(-9.0, 9.0)), max_size=5), st.floats(-1.5, 1.5))
@settings(max_examples=25, deadline=None)
@pytest.mark.slow
def test_a_scan_only_ever_adds(places: list[tuple[float, float]], speed_mps: float) -> None:
    """Whatever it shows: what the camera saw occupied stays so, no water becomes free, no moving obstacle goes."""
    bars = tuple((x_m, y_m, x_m + 0.8, y_m + 0.8) for x_m, y_m in places if math.hypot(x_m, y_m) > 1.5)
    memory, now_us = scanned((6.0, 2.0, 8.0, 4.0), (speed_mps, 0.0), standing=bars)
    edge = water_edge_of(AT_REST, ((4.0, -1.0, 4.6, 1.0),))
    memory = observe_from(edge=edge, memory=memory, at_us=now_us)
    without, seen_alone = map_water(memory.observations, (0.0, 0.0), now_us, CAMERA, PLANNER)
    grid, obstacles = map_water(memory.observations, (0.0, 0.0), now_us, CAMERA, PLANNER, memory.scans)
    assert not (without.occupied & ~grid.occupied).any()
    assert not (grid.free & ~without.free).any()
    assert not (grid.blind_zone & ~without.blind_zone).any()
    assert obstacles[: len(seen_alone)] == seen_alone


def test_an_old_scan_and_one_of_the_future_add_nothing() -> None:
    memory, now_us = scanned((-8.0, -1.0, -6.0, 1.0), (1.0, 0.0))
    assert scan_water(memory.scans, now_us + round(PLANNER.scan_max_age_s * 1e6) + 1, PLANNER) is None
    assert scan_water(memory.scans, START_US - 1, PLANNER) is None
    assert scan_water((), now_us, PLANNER) is None


def test_without_prediction_every_echo_stands() -> None:
    memory, now_us = scanned((-8.0, -1.0, -6.0, 1.0), (1.0, 0.0))
    water = scan_water(memory.scans, now_us, replace(PLANNER, predict=False))
    assert water is not None
    assert water.obstacles == ()
    assert water.standing.size == np.flatnonzero(find_echoes(water.scan)[0] != water.scan.x_m).size > 0


def test_one_beam_is_an_obstacle_and_has_no_velocity() -> None:
    memory, now_us = scanned((-8.05, -0.05, -7.95, 0.05), (1.0, 0.0))
    water = water_of(memory, now_us)
    assert (water.standing.size, water.obstacles) == (1, ())


def test_the_boats_own_motion_is_no_obstacles() -> None:
    """A pile that stands, met by a boat that turns and goes."""
    memory, now_us = scanned(None, boat_mps=0.6, yaw_rate_radps=0.3, standing=((4.0, 1.0, 4.6, 1.6),))
    assert water_of(memory, now_us).obstacles == ()
