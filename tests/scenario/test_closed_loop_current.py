"""The guidance chain in a current that carries the boat on to what lies ahead: it sees that, and never comes to it."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator

import pytest

from paani_sim.eye.camera import BoatPose
from paani_sim.worlds import Current
from tests.guidance_loop import Lockstep, open_water
from tests.scenario.conftest import Launch
from tests.scenario.test_closed_loop_drift import PERFECT
from tests.synthetic_water import CAMERA, PLANNER, Bar, distance_to_bar_m, evidence, water_edge_of

HULL_M = [(ahead, port) for ahead in (-0.55, 0.0, 0.55) for port in (-0.35, 0.0, 0.35)]  # points of it, from its middle
DEAD_END: tuple[Bar, ...] = ((4.0, -4.0, 6.0, 4.0), (-3.0, 4.0, 6.0, 5.0), (-3.0, -5.0, 6.0, -4.0))


def gap_m(boat: BoatPose, bars: tuple[Bar, ...]) -> float:
    """From the hull to the nearest bar."""
    cos, sin = math.cos(boat.yaw_rad), math.sin(boat.yaw_rad)
    points = [(boat.x_m + a * cos - p * sin, boat.y_m + a * sin + p * cos) for a, p in HULL_M]
    return min(distance_to_bar_m(x_m, y_m, bar) for x_m, y_m in points for bar in bars)


def sail_among(boat: Lockstep, bars: tuple[Bar, ...], seconds: float) -> Iterator[tuple[BoatPose, str]]:
    """The boat's poses and its leg in words. It starts at the origin, heading 0, along a path on which the bars lie."""
    boat.camera = CAMERA
    start, (x0_m, y0_m) = boat.world.start, boat.plant.position_m
    cos, sin = math.cos(start.yaw_rad), math.sin(start.yaw_rad)
    for number, _ in enumerate(boat.run(seconds)):
        x_m, y_m = boat.plant.position_m
        east_m, north_m = x_m - x0_m, y_m - y0_m
        assert boat.odometry is not None
        here = BoatPose(
            cos * east_m + sin * north_m, cos * north_m - sin * east_m, boat.odometry.yaw_rad - start.yaw_rad
        )
        if number % 2 == 0:
            boat.evidence = evidence(boat.now_us, water_edge_of(here, bars))
        yield here, "" if boat.command is None else boat.command.leg


@pytest.mark.slow
@pytest.mark.parametrize("toward_deg", [-45.0, 0.0, 45.0])
def test_a_boat_in_a_dead_end_is_not_carried_on_to_what_bars_its_way(launch: Launch, toward_deg: float) -> None:
    """4 m from a wall with arms, 8 m apart, in 0.2 m/s of current; the boat without a path is kept where it is."""
    lake = open_water("lake")
    current = Current(speed_mps=0.2, toward_rad=lake.start.yaw_rad + math.radians(toward_deg))
    poses = sail_among(launch(dataclasses.replace(lake, current=current), "paani", *PERFECT), DEAD_END, 45.0)
    assert min(gap_m(here, DEAD_END) for here, _ in poses) > 0.2


@pytest.mark.slow
@pytest.mark.parametrize("barred_s", [0.0, PLANNER.barred_s])
def test_a_boat_finds_its_way_out_of_a_dead_end_and_round_it(launch: Launch, barred_s: float) -> None:
    """Within 90 s: back first, past the end of an arm; without a way round it lies before the wall."""
    least_m, farthest_m, says_so = math.inf, 0.0, False
    lake = dataclasses.replace(open_water("lake"), current=Current())
    boat = launch(lake, "paani", *PERFECT, f"navigator.planner.barred_s={barred_s}")
    for here, leg in sail_among(boat, DEAD_END, 90.0):
        least_m, farthest_m = min(least_m, gap_m(here, DEAD_END)), max(farthest_m, here.x_m)
        says_so |= "by a way round what bars it" in leg
        if here.x_m > DEAD_END[0][2] + 2.0:
            break
    assert least_m > 0.2
    assert says_so is (farthest_m > DEAD_END[0][2] + 2.0) is (barred_s > 0.0)
