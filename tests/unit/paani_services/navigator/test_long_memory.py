"""What the navigator remembers over a slow turn, and what it does not where dead reckoning begins anew."""

from __future__ import annotations

import math

import pytest

from paani import messages as m
from paani_services.navigator.interlocks import NavigatorInputs
from paani_services.navigator.mapping.observed_cells import CELL_M
from paani_services.navigator.mapping.occupancy_grid import build_occupancy_grid
from paani_services.navigator.navigate import NavigatorState, navigate
from paani_sim.eye.camera import BoatPose
from tests.synthetic_water import (
    AT_REST,
    CAMERA,
    CONFIG,
    EMPTY_MEMORY,
    PLANNER,
    START_US,
    evidence,
    observe_from,
    odometry,
    water_edge_of,
)
from tests.unit.paani_services.navigator.test_interlocks import MISSION

BAR_M = (2.0, -0.4, 2.8, 0.4)  # west, south, east, north


@pytest.mark.parametrize("period_us", [800_000, 1_600_000])
def test_a_slow_turn_on_the_spot_forgets_no_side(period_us: int) -> None:
    memory, at_us = EMPTY_MEMORY, START_US
    for degrees in range(0, 315, 5):
        boat = BoatPose(0.0, 0.0, math.remainder(math.radians(degrees), math.tau))
        memory = observe_from(boat, edge=water_edge_of(boat, (BAR_M,)), at_us=at_us, memory=memory)
        at_us += period_us
    grid = build_occupancy_grid(memory.observations, (0.0, 0.0), at_us, CAMERA, PLANNER)
    row, column = round(-grid.south_m / CELL_M), round((2.1 - grid.west_m) / CELL_M)
    assert grid.occupied[row - 1 : row + 2, column - 1 : column + 3].any()


def test_a_station_of_before_dead_reckoning_began_anew_is_kept_no_more() -> None:
    """It began anew where the map is, a metre away: without that, the boat would go astern to no place of its own."""
    state, now_us = NavigatorState(), START_US

    def step(x_m: float) -> m.NavCommand:
        nonlocal state
        inputs = NavigatorInputs(
            advisory=m.Advisory(
                source_us=now_us,
                direction=m.Direction.STOP,
                reason=m.Reason.NO_SAFE_SIDE,
                may_keep_station=True,
            ),
            advisory_us=now_us,
            odometry=odometry(now_us, BoatPose(x_m, 0.0, 0.0)),
            odometry_us=now_us,
            clock=m.SimTime(source_us=now_us, sim_us=now_us, stamp_us=now_us),
            clock_us=now_us,
            arming=m.Arming(source_us=now_us, armed=True),
            arming_us=now_us,
            evidence=evidence(now_us, water_edge_of(AT_REST)),
        )
        state, command = navigate(state, inputs, MISSION, now_us, 43, CONFIG.navigator, CAMERA)
        return command

    for _ in range(60):
        now_us += 100_000
        assert step(0.0).astern_mps == 0.0
    for gap_us in (round(PLANNER.max_reckon_s * 1e6) + 50_000, *(100_000,) * 20):
        now_us += gap_us
        assert step(1.2).astern_mps == 0.0
