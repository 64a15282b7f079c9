"""The map as others see it is the one that plans are made on, where the boat is in the map."""

from __future__ import annotations

import math

import pytest
from msgspec.structs import replace

from paani import messages as m
from paani.config import CalibrationConfig
from paani.occupancy_cells import unpack_cells
from paani_services.navigator.avoidance.replanning import PlannerState
from paani_services.navigator.mapping.observed_cells import Camera
from paani_services.navigator.occupancy import occupancy_around
from tests.synthetic_water import AT_REST, CAMERA, CONFIG, PLANNER, START_US, observe_from, odometry, water_edge_of
from tests.unit.paani_services.navigator.mapping.test_track_identity import watch

NAVIGATOR = replace(CONFIG.navigator, planner=PLANNER)
NOW_US = START_US + 200_000
BUOY_5_M_AHEAD = ((5.0, -1.0, 5.6, 1.0),)


def seen() -> PlannerState:
    return PlannerState(memory=observe_from(edge=water_edge_of(AT_REST, BUOY_5_M_AHEAD)))


def at(grid: m.OccupancyGrid | None, x_m: float, y_m: float) -> m.Occupancy:
    assert grid is not None
    row, column = math.floor((y_m - grid.south_m) / grid.cell_m), math.floor((x_m - grid.west_m) / grid.cell_m)
    return m.Occupancy(int(unpack_cells(grid)[row, column]))


@pytest.mark.parametrize("offset_m", [(0.0, 0.0), (100.0, -50.0)])
def test_what_was_seen_lies_where_the_boat_is_in_the_map(offset_m: tuple[float, float]) -> None:
    east_m, north_m = offset_m
    here = replace(odometry(NOW_US, AT_REST), x_m=east_m, y_m=north_m)
    grid = occupancy_around(seen(), here, NOW_US, CAMERA, NAVIGATOR)
    assert at(grid, east_m + 5.1, north_m) is m.Occupancy.OCCUPIED
    assert at(grid, east_m + 4.0, north_m) is m.Occupancy.FREE
    assert at(grid, east_m + 0.3, north_m) is m.Occupancy.BLIND_ZONE
    assert at(grid, east_m - 4.0, north_m) is m.Occupancy.UNKNOWN
    assert grid is not None
    assert grid.source_us == NOW_US


def test_where_something_moving_is_no_more_is_free() -> None:
    """As in the grid that plans are made on: where a swimmer was a while ago is occupied by nobody."""
    planner, _, now_us = watch(16, with_tracks=True)
    here = odometry(now_us, AT_REST)
    moving = occupancy_around(planner, here, now_us, CAMERA, NAVIGATOR)
    still = occupancy_around(planner, here, now_us, CAMERA, replace(NAVIGATOR, planner=replace(PLANNER, predict=False)))
    assert [at(grid, 5.0, -1.1) for grid in (still, moving)] == [m.Occupancy.OCCUPIED, m.Occupancy.FREE]
    assert at(moving, 5.0, 0.5) is m.Occupancy.OCCUPIED


def test_nothing_is_told_that_is_not_known() -> None:
    here, unhealthy = odometry(NOW_US, AT_REST), odometry(NOW_US, AT_REST, healthy=False)
    assert occupancy_around(seen(), None, NOW_US, CAMERA, NAVIGATOR) is None
    assert occupancy_around(seen(), unhealthy, NOW_US, CAMERA, NAVIGATOR) is None
    assert occupancy_around(PlannerState(), here, NOW_US, CAMERA, NAVIGATOR) is None
    assert occupancy_around(seen(), here, NOW_US, Camera(CalibrationConfig()), NAVIGATOR) is None
