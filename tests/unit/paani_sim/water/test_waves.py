"""Wind sea: JONSWAP's height, deep water, and what a hull feels of it."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paani_sim.water.waves import (
    COMPONENTS,
    GRAVITY_MPS2,
    Component,
    hull_response,
    peak_omega_radps,
    significant_height_m,
    wind_sea,
)

LENGTH_M, SPACING_M = 1.3, 0.57


def sea(wind_mps: float, fetch_m: float = 200.0, seed: int = 1) -> tuple[Component, ...]:
    return wind_sea(wind_mps, 0.5, fetch_m, np.random.default_rng(seed))


def height_m(waves: tuple[Component, ...]) -> float:
    """Four standard deviations of the surface."""
    return 4.0 * math.sqrt(sum(wave.amplitude_m**2 for wave in waves) / 2.0)


@pytest.mark.parametrize(("wind_mps", "expected_m"), [(3.0, 0.022), (6.0, 0.043), (10.0, 0.072)])
def test_height_of_a_200_m_lake(wind_mps: float, expected_m: float) -> None:
    """Hasselmann 1973: Hs = 0.0016 sqrt(gF/U^2) U^2/g; the sum of the spectrum agrees within 8 %."""
    assert significant_height_m(wind_mps, 200.0) == pytest.approx(expected_m, abs=5e-4)
    assert height_m(sea(wind_mps)) == pytest.approx(significant_height_m(wind_mps, 200.0), rel=0.08)


def test_deep_water_dispersion_and_equal_shares() -> None:
    waves = sea(6.0)
    assert len(waves) == COMPONENTS
    for wave in waves:
        k = math.hypot(wave.kx_radpm, wave.ky_radpm)
        assert wave.omega_radps**2 == pytest.approx(GRAVITY_MPS2 * k)
        assert wave.amplitude_m == waves[0].amplitude_m
    middle = sorted(wave.omega_radps for wave in waves)[COMPONENTS // 2]
    assert middle == pytest.approx(1.12 * peak_omega_radps(6.0, 200.0), rel=0.08)


def test_waves_run_with_the_wind() -> None:
    waves = sea(6.0)
    directions = [math.atan2(wave.ky_radpm, wave.kx_radpm) - 0.5 for wave in waves]
    assert max(map(abs, directions)) < 0.5 * math.pi
    assert np.mean(directions) == pytest.approx(0.0, abs=0.02)


def test_seed_decides_phases() -> None:
    assert sea(6.0, seed=3) == sea(6.0, seed=3)
    assert sea(6.0, seed=3) != sea(6.0, seed=4)


def test_no_wind_or_no_fetch_is_flat() -> None:
    assert sea(0.0) == sea(6.0, fetch_m=0.0) == ()


@given(st.floats(0.05, 40.0), st.floats(-4.0, 4.0), st.floats(-4.0, 4.0))
def test_response_is_the_average_over_both_pontoons(k: float, toward: float, yaw: float) -> None:
    """Against a numeric average of the wave, and its least-squares slopes, along two lines."""
    kx, ky = k * math.cos(toward), k * math.sin(toward)
    response = hull_response(kx, ky, yaw, LENGTH_M, SPACING_M)
    along = (np.arange(2000) + 0.5) / 2000 * LENGTH_M - 0.5 * LENGTH_M
    x, y = np.meshgrid(along, [-0.5 * SPACING_M, 0.5 * SPACING_M])
    phase = k * (x * math.cos(toward - yaw) + y * math.sin(toward - yaw))
    assert response.elevation == pytest.approx(float(np.cos(phase).mean()), abs=1e-5)
    assert response.slope_ahead_pm == pytest.approx(float((np.sin(phase) * x).sum() / (x * x).sum()), abs=1e-4 * k)
    assert response.slope_left_pm == pytest.approx(float((np.sin(phase) * y).sum() / (y * y).sum()), abs=1e-4 * k)


def test_hull_averages_short_waves_away() -> None:
    """A wave as long as the hull lifts it no more; one ten times as long lifts it almost as the water."""
    at_length = hull_response(2.0 * math.pi / LENGTH_M, 0.0, 0.0, LENGTH_M, SPACING_M)
    long = hull_response(0.2 * math.pi / LENGTH_M, 0.0, 0.0, LENGTH_M, SPACING_M)
    assert at_length.elevation == pytest.approx(0.0, abs=1e-9)
    assert long.elevation == pytest.approx(1.0, abs=0.02)
