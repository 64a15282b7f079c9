"""Vessels adrift: they are told from moored ones in time, and taken to come nearer while out of sight."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paani.messages import Label
from paani_services.navigator.avoidance.clearance import clearance_fields_m, predicted_clearance_m
from paani_services.navigator.avoidance.constraints import ESCAPE_TOLERANCE_M
from paani_services.navigator.avoidance.rollout import BoatState, GuidanceSetpoint, roll_out
from paani_services.navigator.mapping.dynamic_obstacles import DynamicObstacle, find_dynamic_obstacles
from paani_services.navigator.mapping.observation import ObservationMemory
from paani_services.navigator.mapping.observed_cells import CELL_M
from paani_services.navigator.mapping.occupancy_grid import GRID_CELLS, OccupancyGrid, build_occupancy_grid
from paani_services.navigator.mapping.velocity_fit import Velocity
from paani_sim.eye.camera import BoatPose
from tests.synthetic_water import (
    AT_REST,
    CAMERA,
    PLANNER,
    START_US,
    Bar,
    detection_of,
    observe_from,
    observe_then_look_astern,
    plan_on,
    water_edge_of,
)

HULL: Bar = (4.0, -1.0, 5.0, 1.0)


def passed(seconds: float, label: Label = Label.VESSEL) -> tuple[ObservationMemory, int]:
    """The memory of a boat that saw a hull ahead, and has looked astern since."""
    return observe_then_look_astern(seconds, detection_of(HULL, 0.8, label), water_edge_of(AT_REST, (HULL,)))


def off_m(grid: OccupancyGrid) -> float:
    """Distance ahead of the boat to the nearest cell without clearance."""
    clear_m = clearance_fields_m(grid, PLANNER)[0]
    row = int(-grid.south_m / CELL_M)
    columns = np.flatnonzero(clear_m[row] <= 0.0)
    return float(grid.west_m + CELL_M * (columns.min() + 0.5))


@pytest.mark.parametrize(("seconds", "nearer_m"), [(0.8, 0.0), (3.2, 0.48), (6.4, 0.96), (16.0, 1.2)])
def test_a_vessel_out_of_sight_may_drift(seconds: float, nearer_m: float) -> None:
    """It comes nearer at 0.15 m/s (Q6), up to 1.2 m."""
    memory, now_us = passed(seconds)
    grid = build_occupancy_grid(memory.observations, (0.0, 0.0), now_us, CAMERA, PLANNER)
    assert off_m(grid) == pytest.approx(4.0 - nearer_m, abs=1.5 * CELL_M)
    still = msgspec.structs.replace(PLANNER, vessel_reach_m=0.0)
    assert not build_occupancy_grid(memory.observations, (0.0, 0.0), now_us, CAMERA, still).reachable_unseen.any()


@pytest.mark.parametrize("label", [Label.PIER, Label.BUOY])
def test_a_pier_or_buoy_drifts_no_further_than_any_occluded_cell(label: Label) -> None:
    memory, now_us = passed(16.0, label)
    grid = build_occupancy_grid(memory.observations, (0.0, 0.0), now_us, CAMERA, PLANNER)
    assert not grid.reachable_unseen.any()
    assert off_m(grid) == pytest.approx(4.0 - PLANNER.hidden_drift_m, abs=1.5 * CELL_M)


def test_a_vessel_has_not_drifted_to_where_a_picture_shows_water() -> None:
    memory, now_us = passed(12.0)
    memory = observe_from(BoatPose(0.0, 0.0, 0.7), at_us=now_us + 200_000, memory=memory)
    grid = build_occupancy_grid(memory.observations, (0.0, 0.0), now_us + 200_000, CAMERA, PLANNER)
    assert grid.reachable_unseen.any()
    assert not (grid.reachable_unseen & grid.free).any()


def watched(
    velocity_mps: tuple[float, float], x_m: float, y_m: float, label: Label = Label.VESSEL
) -> tuple[DynamicObstacle, ...]:
    """The obstacles that move for certain, after a boat at rest has watched a hull for 8 s on its way to this place."""
    memory, at_us = ObservationMemory(), START_US
    for k in range(41):
        left_s = 0.2 * (40 - k)
        east, north = x_m - left_s * velocity_mps[0], y_m - left_s * velocity_mps[1]
        hull: Bar = (east - 0.4, north - 1.0, east + 0.4, north + 1.0)
        at_us = START_US + 200_000 * k
        box = detection_of(hull, 0.8, label)
        x1, y1, x2, y2 = box.box_xyxy
        cut = msgspec.structs.replace(box, box_xyxy=(max(x1, 0.0), y1, min(x2, 1.0), min(y2, 1.0)))
        memory = observe_from(edge=water_edge_of(AT_REST, (hull,)), at_us=at_us, memory=memory, detections=(cut,))
    return tuple(each for each in find_dynamic_obstacles(memory.observations, at_us, CAMERA, PLANNER) if each.is_moving)


@pytest.mark.parametrize("velocity", [(0.0, 0.13), (-0.13, 0.0), (-0.09, -0.09)])
@pytest.mark.parametrize("side_m", [0.0, 2.2, -2.2])  # at 2.2 m one end is outside the picture
@pytest.mark.slow
def test_a_vessel_adrift_is_told_from_a_moored_one_in_8_s(velocity: tuple[float, float], side_m: float) -> None:
    """0.13 m/s is 0.33 m in `fit_s`, as much as one row of the mask at 4 m; in 8 s it is 1 m."""
    (vessel,) = watched(velocity, 4.0, side_m)
    assert vessel.velocity[:2] == pytest.approx(velocity, abs=1.3 * vessel.velocity.deviation_mps)
    assert vessel.velocity.deviation_mps <= 0.05


@settings(max_examples=20, deadline=None)
@given(
    speed_mps=st.one_of(st.floats(-0.5, -0.16), st.floats(0.13, 0.2)),
    past_m=st.floats(1.9, 2.4),
    side=st.sampled_from([-1.0, 1.0]),
)
@pytest.mark.slow
def test_a_vessel_that_the_picture_s_side_cuts_is_not_taken_for_moored(
    speed_mps: float, past_m: float, side: float
) -> None:
    """It comes in or goes out; the end that is in the picture shows that it moves, however little was seen of it whole.

    Faster ones than those that drift are known by no more than their end as well.
    """
    (vessel,) = watched((0.0, side * speed_mps), 4.0, side * past_m)
    assert vessel.velocity.north_mps * side * speed_mps > 0.0
    assert 0.5 < vessel.velocity.north_mps / (side * speed_mps) < 1.5


@pytest.mark.parametrize("side_m", [0.0, 1.9, -1.9, 2.2])
def test_a_moored_vessel_is_static(side_m: float) -> None:
    assert watched((0.0, 0.0), 4.0, side_m) == ()


def test_a_pier_is_never_adrift() -> None:
    assert watched((-0.1, 0.0), 4.0, 0.0, Label.PIER) == ()


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_waiting_boat_pivots_to_its_course(side: float) -> None:
    """It sees what passes and keeps to its course; a hull that cannot pivot stays as it is."""
    grid = build_occupancy_grid(observe_from().observations, (0.0, 0.0), START_US, CAMERA, PLANNER)
    resting, setpoint = BoatState(0.0, 0.0, 0.0), GuidanceSetpoint(1.8 * side, 0.6)
    drifting = DynamicObstacle(
        np.array([0.3]), np.array([2.6 * side]), 0.2, Velocity(0.08, 0.0, 0.03), 3.0, frozenset()
    )
    found = plan_on(grid, resting, setpoint, None, PLANNER, (drifting,))
    assert found.speed_mps == pytest.approx(0.06)
    assert found.heading_rad == pytest.approx(1.8 * side)
    on = roll_out(resting, np.array([found.heading_rad]), np.array([found.speed_mps]), PLANNER)
    near = on.time_s <= PLANNER.horizon_s
    assert np.hypot(on.x_m, on.y_m)[near].max() < 0.2
    turned = BoatState(0.0, 0.0, 1.8 * side)
    assert plan_on(grid, turned, setpoint, None, PLANNER, (drifting,)).speed_mps == 0.0
    pushes_only = msgspec.structs.replace(PLANNER, turn_radius_m=0.5)
    assert plan_on(grid, resting, setpoint, None, pushes_only, (drifting,)).speed_mps == 0.0


@pytest.mark.parametrize("course_deg", [0.0, 60.0, 170.0])
def test_a_boat_leaves_where_an_unseen_obstacle_may_have_got_to(course_deg: float) -> None:
    """A boat inside cells that an unseen obstacle may have reached moves away from it, with open water ahead."""
    grid, start = (
        build_occupancy_grid(observe_from().observations, (0.0, 0.0), START_US, CAMERA, PLANNER),
        BoatState(0.0, 0.0, 0.0),
    )
    middle_m = CELL_M * (np.arange(GRID_CELLS) + 0.5)
    east_m, north_m = grid.west_m + middle_m[None, :] + 1.6, grid.south_m + middle_m[:, None] - 1.2
    grid = grid._replace(reachable_unseen=(np.hypot(east_m, north_m) < 2.8) & ~grid.free)
    assert clearance_fields_m(grid, PLANNER)[0][GRID_CELLS // 2, GRID_CELLS // 2] < -0.3
    coming = DynamicObstacle(np.array([-1.6]), np.array([1.2]), 0.2, Velocity(0.1, -0.08, 0.05), 14.0, frozenset())
    assert predicted_clearance_m(coming, np.zeros(1), np.zeros(1), np.zeros(1))[0] < 0.0  # it may be here
    found = plan_on(grid, start, GuidanceSetpoint(np.radians(course_deg), 0.6), None, PLANNER, (coming,))
    assert 0.0 < found.speed_mps < 0.6
    on = roll_out(start, np.array([found.heading_rad]), np.array([found.speed_mps]), PLANNER)
    gaps_m = predicted_clearance_m(coming, on.x_m, on.y_m, on.time_s[:, None])[on.time_s <= PLANNER.horizon_s]
    rests_m = predicted_clearance_m(coming, np.zeros(1), np.zeros(1), on.time_s[:, None])[
        on.time_s <= PLANNER.horizon_s
    ]
    assert (gaps_m >= rests_m - ESCAPE_TOLERANCE_M).all()
    assert gaps_m[-1] > rests_m[-1]
