"""Integral line of sight: path following in a drift that the compass does not show."""

from __future__ import annotations

import math

import msgspec
import pytest

from paani.config import NavigatorConfig, load_config
from paani.messages import Odometry, Route, Waypoint
from paani.missions import mission_of_route
from paani_services.navigator.guidance.ilos import IlosState, integral_offset_m, integrate
from paani_services.navigator.guidance.path_progress import WaypointPath
from tests.unit.paani_services.navigator.drifting_boat import DriftingBoat

PAANI = load_config().navigator
PAPER = load_config(profile="paper").navigator
WITHOUT_INTEGRAL = msgspec.structs.replace(PAANI, crab_gain_mps=0.0)


def route(*points: tuple[float, float], repeat: bool = False) -> Route:
    return Route(source_us=0, name="r", waypoints=tuple(Waypoint(x_m=x, y_m=y) for x, y in points), repeat=repeat)


STRAIGHT = route((0, 0), (400, 0))


def heading(yaw_rad: float) -> Odometry:
    return Odometry(source_us=0, x_m=0.0, y_m=0.0, yaw_rad=yaw_rad, surge_mps=0.6, healthy=True)


def max_cross_track_m(config: NavigatorConfig, drift_mps: tuple[float, float], settle_s: float = 90.0) -> float:
    """Largest cross-path error over a minute after `settle_s`."""
    boat = DriftingBoat(mission_of_route(STRAIGHT), config, drift_mps=drift_mps)
    boat.settle(settle_s)
    return max(abs(boat.y_m) for _ in boat.run(60.0))


@pytest.mark.parametrize("drift_mps", [(0.0, 0.15), (0.0, -0.2), (0.1, 0.2)])
@pytest.mark.slow
def test_a_steady_drift_leaves_no_cross_track_error(drift_mps: tuple[float, float]) -> None:
    assert max_cross_track_m(WITHOUT_INTEGRAL, drift_mps) > 0.7
    assert max_cross_track_m(PAANI, drift_mps) < 0.05


def test_without_drift_the_integral_stays_zero() -> None:
    boat = DriftingBoat(mission_of_route(STRAIGHT), PAANI)
    boat.settle(60.0)
    assert boat.state.ilos == IlosState(updated_us=boat.now_us)


def test_m4_the_paper_s_bearing_has_no_integral() -> None:
    """M4: the plain bearing of the waypoint, whatever drifts the boat."""
    boat = DriftingBoat(mission_of_route(STRAIGHT), PAPER, drift_mps=(0.0, 0.05))
    order = boat.settle(60.0)
    before_m = boat.y_m - 0.05 * 0.1 - boat.speed_mps * math.sin(boat.yaw_rad) * 0.1
    x_m = boat.x_m - boat.speed_mps * math.cos(boat.yaw_rad) * 0.1
    assert order.heading_rad == pytest.approx(math.atan2(-before_m, 400.0 - x_m), abs=1e-9)
    assert boat.state.ilos.north_m == 0.0


@pytest.mark.slow
def test_the_integral_holds_on_a_leg_in_the_opposite_direction() -> None:
    """A drift comes from one side of the map, so the integral changes its sign with the direction of the leg."""
    boat = DriftingBoat(mission_of_route(route((0, 0), (60, 0), (60, 3), (0, 3))), PAANI, drift_mps=(0.0, 0.15))
    worst_m = 0.0
    for order in boat.run(260.0):
        if order.waypoint_index == 3 and boat.x_m < 45.0:
            worst_m = max(worst_m, abs(boat.y_m - 3.0))
    assert boat.state.progress.waypoints_reached >= 3
    assert worst_m < 0.4


@pytest.mark.slow
def test_the_crab_angle_is_bounded() -> None:
    """In a drift that the boat cannot hold against, the integral does not wind up without end."""
    boat = DriftingBoat(mission_of_route(STRAIGHT), PAANI, drift_mps=(0.0, 0.9))
    boat.settle(300.0)
    most_m = PAANI.lookahead_m * math.tan(math.radians(PAANI.max_crab_deg))
    assert math.hypot(boat.state.ilos.east_m, boat.state.ilos.north_m) <= most_m + 1e-9


def test_the_integral_grows_by_borhaug_s_equation() -> None:
    """y = 2 m left, s = 1 m, L = 4 m, sigma = 0.25 m/s: s grows by 0.25 * 4 * 2 / (9 + 16) m each second."""
    path = WaypointPath((Waypoint(x_m=0, y_m=0), Waypoint(x_m=0, y_m=50)))
    ilos = integrate(
        IlosState(east_m=-1.0, updated_us=1_000_000), path, 1, 2.0, heading(0.5 * math.pi), 1_100_000, PAANI
    )
    assert integral_offset_m(ilos, path, 1) == pytest.approx(1.0 + 0.1 * 0.25 * 4.0 * 2.0 / 25.0)


def test_a_gap_in_time_is_integrated_as_a_short_step() -> None:
    path = WaypointPath((Waypoint(x_m=0, y_m=0), Waypoint(x_m=50, y_m=0)))
    after_gap = integrate(IlosState(updated_us=1), path, 1, 1.0, heading(0.0), 60_000_000, PAANI)
    assert 0.0 < after_gap.north_m < 0.3 * 0.25


@pytest.mark.parametrize("off_m", [2.0, 5.0, 10.0])
@pytest.mark.slow
def test_the_integral_is_held_while_the_boat_closes_in_on_its_leg(off_m: float) -> None:
    """A cross-path error that shrinks is no drift: the boat joins from afar and overshoots by no more than 0.2 m."""
    boat = DriftingBoat(mission_of_route(STRAIGHT), PAANI, (0.0, off_m))
    assert min(boat.y_m for _ in boat.run(120.0)) > -0.2
