"""The simulated echo sounder: its errors, its blind zone, and how it fails."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paani.config import PlantConfig, SensorsConfig
from paani_sim.plant.plant import Plant
from paani_sim.plant.sonar import Sonar
from paani_sim.worlds import Fault, FaultKind, Shoal, load_world

CONFIG = SensorsConfig(sonar=True)
DRAUGHT_M = 0.19


def sonar(config: SensorsConfig = CONFIG, seed: int = 3) -> Sonar:
    return Sonar(config, DRAUGHT_M, np.random.default_rng(seed))


@given(st.floats(0.6, 49.0))
def test_its_error_is_a_centimetre_and_one_in_a_hundred(depth_m: float) -> None:
    device = sonar()
    errors_m = np.array([(device.measure(depth_m, 0.0, (), 0.0) or np.nan) - depth_m for _ in range(400)])
    std_m = np.hypot(0.01, 0.01 * (depth_m - DRAUGHT_M))
    assert abs(errors_m.mean()) < 0.3 * std_m
    assert 0.8 * std_m < errors_m.std() < 1.2 * std_m


@pytest.mark.parametrize(
    ("depth_m", "has_echo"), [(0.1, False), (0.48, False), (0.5, True), (50.1, True), (50.3, False)]
)
def test_it_hears_nothing_too_near_and_too_far(depth_m: float, has_echo: bool) -> None:
    """Its blind zone and its range count from the transducer, at the keel."""
    assert (sonar().measure(depth_m, 0.0, (), 0.0) is not None) is has_echo


def test_a_wave_that_lifts_the_boat_makes_the_water_deeper_for_it() -> None:
    exact = SensorsConfig(sonar=True, sonar_std_m=0.0, sonar_std_frac=0.0)
    assert sonar(exact).measure(2.0, 0.1, (), 0.0) == pytest.approx(2.1)


def test_frozen_it_repeats_the_last_depth_or_the_one_of_the_fault() -> None:
    held, stated = (Fault(FaultKind.SONAR_FROZEN, 1.0, 2.0, amount) for amount in (0.0, 4.5))
    device = sonar()
    last_m = device.measure(2.0, 0.0, (held,), 0.5)
    assert {device.measure(depth_m, 0.0, (held,), 2.0) for depth_m in (2.0, 1.0, 0.1)} == {last_m}
    assert {device.measure(depth_m, 0.0, (stated,), 2.0) for depth_m in (2.0, 0.1)} == {4.5}
    assert device.measure(1.0, 0.0, (held,), 3.5) == pytest.approx(1.0, abs=0.1)


def test_the_plant_measures_under_the_boat() -> None:
    lake = load_world("lake")
    world = dataclasses.replace(lake, obstacles=(), actors=(), shoals=(Shoal(10.0, 5.0, 6.0, 0.8),), bottom_m=2.0)
    plant = Plant(world, PlantConfig(sensors=CONFIG))
    try:
        plant.place(10.0, 5.0, 0.3)
        assert plant.read_sonar() == pytest.approx(0.8, abs=0.06)
        plant.place(20.0, 5.0, 0.3)
        assert plant.read_sonar() == pytest.approx(2.0, abs=0.1)
    finally:
        plant.close()


@pytest.mark.slow
@pytest.mark.parametrize(("top_m", "is_touched"), [(0.05, True), (0.15, True), (0.25, False)])
def test_the_keel_grounds_where_the_water_is_less_deep_than_its_draught(top_m: float, is_touched: bool) -> None:
    lake = load_world("lake")
    shoal = Shoal(4.0, 0.0, 5.0, top_m)
    world = dataclasses.replace(lake, obstacles=(), actors=(), shoals=(shoal,), bottom_m=2.0)
    plant = Plant(world, PlantConfig())
    try:
        plant.place(-3.0, 0.0, 0.0)
        for _ in range(1400):
            plant.step(6.0, 6.0)
        assert {each.name for each in plant.touches} == ({"shoal_0"} if is_touched else set())
    finally:
        plant.close()
