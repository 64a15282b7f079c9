"""Gusts, the wind's force, and the current's profile."""

import dataclasses
import math
import statistics

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paani_sim.vessels import load_vessel
from paani_sim.water.current import CurrentField
from paani_sim.water.wind import AIR_DENSITY_KGPM3, Gusts, wind_force
from paani_sim.worlds import Current, Wind, load_world

WINDAGE = load_vessel("otter").windage
LENGTH_M = 1.3
airs = st.floats(-12.0, 12.0)


def gusts(count: int, wind: Wind, seed: int = 1) -> list[float]:
    air = Gusts(wind, 0.1, np.random.default_rng(seed))
    found = []
    for _ in range(count):
        found.append(math.hypot(*air.velocity_mps))
        air.advance()
    return found


@pytest.mark.slow
def test_gusts_have_their_spread_and_time_constant() -> None:
    speeds = gusts(60_000, Wind(6.0, 0.6, gust_frac=0.2, gust_s=5.0))
    assert statistics.fmean(speeds) == pytest.approx(6.0, abs=0.25)
    assert statistics.pstdev(speeds) == pytest.approx(1.2, rel=0.1)
    assert statistics.correlation(speeds[:-50], speeds[50:]) == pytest.approx(math.exp(-1.0), abs=0.1)


def test_steady_wind_is_steady_and_seeds_differ() -> None:
    assert gusts(50, Wind(6.0, 0.6)) == pytest.approx([6.0] * 50)
    gusty = Wind(6.0, 0.6, gust_frac=0.2)
    assert gusts(50, gusty) == gusts(50, gusty)
    assert gusts(50, gusty) != gusts(50, gusty, seed=2)


def test_wind_force_by_hand() -> None:
    """0.5 x 1.225 x 36 = 22.05 Pa: on the bow 22.05 x 0.5 x 0.15, on the side 22.05 x 0.7 x 0.30."""
    assert pytest.approx(1.225) == AIR_DENSITY_KGPM3
    assert wind_force(-6.0, 0.0, WINDAGE, LENGTH_M) == pytest.approx((-1.654, 0.0, 0.0), abs=1e-3)
    assert wind_force(0.0, 6.0, WINDAGE, LENGTH_M) == pytest.approx((0.0, 4.631, 0.0), abs=1e-3)


@given(airs, airs)
def test_wind_pushes_downwind_and_turns_broadside(ahead: float, left: float) -> None:
    force = wind_force(ahead, left, WINDAGE, LENGTH_M)
    assert force[0] * ahead + force[1] * left >= 0.0
    assert force[2] * ahead * left <= 0.0


def test_current_follows_the_channel_and_fades_towards_its_banks() -> None:
    """Prandtl's one-seventh power of the distance to the bank: half way out still 0.906 of the middle."""
    world = dataclasses.replace(load_world("river"), current=Current(speed_mps=0.5))
    assert world.channel_m is not None
    field = CurrentField(world)
    middle = len(world.channel_m) // 2
    here, ahead = world.channel_m[middle], world.channel_m[middle + 1]
    along = (ahead - here) / np.linalg.norm(ahead - here)
    bank_m = float(np.linalg.norm(world.shore_m - here, axis=1).min())
    left = np.array([-along[1], along[0]])
    speeds = [np.array(field.at(*(here + part * bank_m * left))) for part in (0.0, 0.5, 0.9, 1.3)]
    assert np.linalg.norm(speeds[0]) == pytest.approx(0.5, rel=0.02)
    assert speeds[0] / np.linalg.norm(speeds[0]) == pytest.approx(along, abs=0.05)
    assert np.linalg.norm(speeds[1]) == pytest.approx(0.5 * 0.5 ** (1.0 / 7.0), rel=0.03)
    assert 0.2 < np.linalg.norm(speeds[2]) < np.linalg.norm(speeds[1])
    assert np.linalg.norm(speeds[3]) == 0.0


def test_current_of_open_water_runs_one_way() -> None:
    world = dataclasses.replace(load_world("lake"), channel_m=None, current=Current(speed_mps=0.2, toward_rad=2.0))
    field = CurrentField(world)
    x_mps, y_mps = field.at(10.0, -5.0)
    assert math.atan2(y_mps, x_mps) == pytest.approx(2.0, abs=1e-5)
    assert 0.15 < math.hypot(x_mps, y_mps) <= 0.2
    assert field.at(1e6, -1e6) == (0.0, 0.0)


def test_still_water() -> None:
    assert CurrentField(load_world("lake")).at(0.0, 0.0) == (0.0, 0.0)


@pytest.mark.slow
def test_current_is_the_same_on_any_number_of_threads() -> None:
    """Drives are the same to the byte on every machine, and in a worker of its own."""
    world = dataclasses.replace(load_world("river"), current=Current(speed_mps=0.3))
    sown, before = np.random.default_rng(5).uniform(-30.0, 300.0, (2000, 2)), cv2.getNumThreads()
    found = []
    try:
        for threads in (1, 2, 4):
            cv2.setNumThreads(threads)
            field = CurrentField(world)
            found.append([field.at(x_m, y_m) for x_m, y_m in sown])
    finally:
        cv2.setNumThreads(before)
    assert found[0] == found[1] == found[2]
