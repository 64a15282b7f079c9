"""The bottom as a plane through soundings, and how sure it is of its slope and depth."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paani_services.navigator.mapping.bottom_plane import PRIOR_SLOPE_STD, STD_FRAC, STD_M, Bottom, fit_bottom


def along_a_line(yaw_rad: float, slope: float = 0.4) -> Iterator[tuple[float, float, float]]:
    for k in range(12):
        along_m = 0.12 * k
        yield along_m * math.cos(yaw_rad), along_m * math.sin(yaw_rad), 3.0 - slope * along_m


def fitted(soundings: Iterator[tuple[float, float, float]] | list[tuple[float, float, float]]) -> Bottom:
    bottom = fit_bottom(list(soundings))
    assert bottom is not None
    return bottom


@given(st.floats(-math.pi, math.pi))
def test_along_a_straight_way_the_bottom_is_taken_to_rise_along_it(yaw_rad: float) -> None:
    bottom = fitted(along_a_line(yaw_rad))
    slope, east, north = bottom.upward
    assert slope == pytest.approx(0.4, abs=0.06)
    assert (east, north) == pytest.approx((math.cos(yaw_rad), math.sin(yaw_rad)), abs=1e-6)
    end_m = 0.12 * 11
    depth_m, _ = bottom.depth_at(end_m * math.cos(yaw_rad), end_m * math.sin(yaw_rad))
    assert depth_m == pytest.approx(3.0 - 0.4 * end_m, abs=0.02)


@given(st.floats(-math.pi, math.pi))
def test_across_a_straight_way_the_bottom_may_rise_as_it_usually_does(yaw_rad: float) -> None:
    """One deviation of the slope beforehand, over the way across."""
    bottom = fitted(along_a_line(yaw_rad))
    _, std_m = bottom.depth_at(-2.0 * math.sin(yaw_rad), 2.0 * math.cos(yaw_rad))
    assert std_m == pytest.approx(2.0 * PRIOR_SLOPE_STD, rel=0.05)


@given(st.floats(-math.pi, math.pi))
def test_a_bend_shows_which_way_the_bottom_rises(up_rad: float) -> None:
    around = [(math.sin(0.2 * k), 1.0 - math.cos(0.2 * k)) for k in range(12)]
    east, north = math.cos(up_rad), math.sin(up_rad)
    _, found_east, found_north = fitted([(x, y, 3.0 - 0.4 * (x * east + y * north)) for x, y in around]).upward
    assert math.hypot(found_east - east, found_north - north) < 0.15


@given(st.integers(0, 10_000), st.floats(0.7, 10.0))
@pytest.mark.slow
def test_noise_on_a_level_bottom_is_seldom_a_slope_and_its_deviation_is_honest(seed: int, depth_m: float) -> None:
    rng = np.random.default_rng(seed)
    std_m = STD_M + STD_FRAC * depth_m
    is_slope, errors = 0, []
    for _ in range(60):
        way = [(0.12 * k, 0.0, depth_m + float(rng.normal(0.0, std_m))) for k in range(12)]
        bottom = fitted(way)
        is_slope += bottom.upward[0] > 0.0
        found_m, found_std_m = bottom.depth_at(2.0, 0.0)
        errors.append((found_m - depth_m) / found_std_m)
    assert is_slope <= 12
    assert 0.5 < float(np.std(errors)) < 1.3


def test_too_few_soundings_and_too_short_a_way_show_nothing() -> None:
    assert fit_bottom(list(along_a_line(0.0))[:4]) is None
    assert fit_bottom([(0.01 * k, 0.0, 3.0 - k) for k in range(12)]) is None
    assert fitted([(0.12 * k, 0.0, 3.0) for k in range(12)]).upward == (0.0, 0.0, 0.0)
