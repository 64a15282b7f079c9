"""Localization that begins anew elsewhere takes mission and fence with it: nothing moves in such a map."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from paani import messages as m
from paani.geometry import geodetic_from_enu
from paani.map_origin import MAP_MOVED_M, is_map_moved, map_place_of
from paani.messages import DriveMode, Inhibit
from paani_services.navigator.modes import follow_order
from paani_services.navigator.navigate import NavigatorState, navigate
from tests.unit.paani_services.navigator.test_interlocks import MISSION
from tests.unit.paani_services.navigator.test_navigate import NOW_US, PAANI, inputs

ORIGIN_DEG = (50.0, 8.0)
METRES = st.floats(-2000.0, 2000.0)


def estimate(
    x_m: float, y_m: float, origin_deg: tuple[float, float] = ORIGIN_DEG, *, healthy: bool = True
) -> m.Odometry:
    """Of a boat at this place of a map that begins there."""
    latitude_deg, longitude_deg = geodetic_from_enu(x_m, y_m, *origin_deg)
    return m.Odometry(
        source_us=NOW_US, x_m=x_m, y_m=y_m, yaw_rad=0.0, surge_mps=0.0, healthy=healthy, latitude_deg=latitude_deg,
        longitude_deg=longitude_deg,
    )  # fmt: skip


@given(METRES, METRES, METRES, METRES)
def test_one_map_is_the_same_wherever_the_boat_is(x_m: float, y_m: float, later_x_m: float, later_y_m: float) -> None:
    assert not is_map_moved(map_place_of(estimate(x_m, y_m)), map_place_of(estimate(later_x_m, later_y_m)))


@given(METRES, METRES, METRES, METRES)
def test_a_map_that_begins_elsewhere_is_another(x_m: float, y_m: float, east_m: float, north_m: float) -> None:
    moved_deg = geodetic_from_enu(east_m, north_m, *ORIGIN_DEG)
    away_m = (east_m * east_m + north_m * north_m) ** 0.5
    found = is_map_moved(map_place_of(estimate(0.0, 0.0)), map_place_of(estimate(x_m, y_m, moved_deg)))
    assert found is (away_m > MAP_MOVED_M) or abs(away_m - MAP_MOVED_M) < 0.05 * MAP_MOVED_M


def halts(state: NavigatorState, pose: m.Odometry, sim_us: int = NOW_US) -> tuple[NavigatorState, tuple[Inhibit, ...]]:
    heard = inputs(odometry=pose, clock=m.SimTime(source_us=NOW_US, sim_us=sim_us, stamp_us=777))
    state, command = navigate(state, heard, MISSION, NOW_US, 43, PAANI)
    return state, command.inhibits


def test_nothing_moves_while_the_map_lies_elsewhere_than_mission_and_fence_were_placed_in() -> None:
    """An estimate that is not healthy, or does not say where on Earth, places nothing."""
    elsewhere = geodetic_from_enu(60.0, 0.0, *ORIGIN_DEG)
    state, found = halts(NavigatorState(), estimate(0.0, 0.0, elsewhere, healthy=False))
    assert Inhibit.UNHEALTHY_ODOMETRY in found
    for x_m in (0.0, 30.0, 60.0):
        state, found = halts(state, estimate(x_m, 0.0))
        assert Inhibit.MAP_MOVED not in found
    for _ in range(3):
        state, found = halts(state, estimate(0.0, 0.0, elsewhere))
        assert Inhibit.MAP_MOVED in found
    assert Inhibit.MAP_MOVED not in halts(state, estimate(60.0, 0.0))[1]


@pytest.mark.parametrize("is_reset", [False, True])
def test_a_simulation_that_was_reset_may_begin_anywhere(*, is_reset: bool) -> None:
    state, _ = halts(NavigatorState(), estimate(0.0, 0.0))
    elsewhere = geodetic_from_enu(60.0, 0.0, *ORIGIN_DEG)
    _, found = halts(state, estimate(0.0, 0.0, elsewhere), 1000 if is_reset else NOW_US + 50_000)
    assert (Inhibit.MAP_MOVED in found) is not is_reset


@pytest.mark.parametrize("mode", DriveMode)
@pytest.mark.parametrize("is_begun_anew", [False, True])
def test_what_was_placed_in_another_map_moves_no_boat_whose_navigator_began_anew(
    mode: DriveMode, *, is_begun_anew: bool
) -> None:
    state = NavigatorState() if is_begun_anew else halts(NavigatorState(), estimate(0.0, 0.0))[0]
    latitude_deg, longitude_deg = ORIGIN_DEG
    order = m.OperatorOrder(
        source_us=NOW_US, mode=mode, since_us=1, surge=0.5, map_latitude_deg=latitude_deg,
        map_longitude_deg=longitude_deg,
    )  # fmt: skip
    for moved_m in (0.0, 60.0):
        heard = inputs(
            odometry=estimate(0.0, 0.0, geodetic_from_enu(moved_m, 0.0, *ORIGIN_DEG)), order=order, order_us=NOW_US
        )
        _, command = follow_order(state, heard, MISSION, NOW_US, 43, PAANI)
        assert command.inhibits.count(Inhibit.MAP_MOVED) == (moved_m > 0.0)
