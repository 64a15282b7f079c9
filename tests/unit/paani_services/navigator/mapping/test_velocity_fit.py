"""How well a velocity is known does not depend on how the map is turned."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paani.messages import Label
from paani_services.navigator.mapping.velocity_fit import PositionMeasurement, VelocityEstimate, fit_velocity

RAY_STD_M, ACROSS_STD_M = 1.15, 0.25  # of a vessel 15 m off


def approaching(bearing_rad: float, rate_hz: float = 5.0, noise_stds: float = 0.0) -> VelocityEstimate:
    """Of a vessel that comes along this bearing at 0.5 m/s.

    noise_stds: the noise of its positions, in their stated deviations.
    """
    rng = np.random.default_rng(0)
    east, north = math.cos(bearing_rad), math.sin(bearing_rad)
    along, across = RAY_STD_M**-2, ACROSS_STD_M**-2
    information = (
        along * east * east + across * north * north,
        (along - across) * east * north,
        along * north * north + across * east * east,
    )
    measurements = []
    for number in range(round(2.4 * rate_hz) + 1):
        along_m, across_m = noise_stds * rng.normal(0.0, (RAY_STD_M, ACROSS_STD_M))
        range_m = 15.0 - 0.5 * number / rate_hz + along_m
        at_m = range_m * east - across_m * north, range_m * north + across_m * east
        outline = (np.array([at_m[0]]), np.array([at_m[1]]))
        measurements.append(
            PositionMeasurement(
                (round(number / rate_hz * 1e6), 0),
                Label.VESSEL,
                at_m,
                information,
                1.0,
                outline,
                (True, True),
                (2.0, 1.0),
            )
        )
    found = fit_velocity(measurements, 2.5)
    assert found is not None
    return found


@given(st.floats(-math.pi, math.pi))
def test_its_deviation_is_that_along_the_line_of_sight_whatever_the_bearing(bearing_rad: float) -> None:
    assert approaching(bearing_rad).deviation_mps == pytest.approx(approaching(0.0).deviation_mps, rel=1e-6)


@pytest.mark.parametrize("bearing_rad", [0.0, 0.7, 2.0])
def test_w10_the_stated_deviation_is_that_of_the_direction_in_which_it_is_largest(bearing_rad: float) -> None:
    found = approaching(bearing_rad)
    east_east, east_north, north_north = found.covariance
    largest = np.linalg.eigvalsh(np.array([[east_east, east_north], [east_north, north_north]])).max()
    assert found.deviation_mps == pytest.approx(math.sqrt(largest))


def test_w10_pictures_that_follow_faster_do_not_make_a_velocity_surer() -> None:
    """Their errors are the same: at 20 Hz as at 5 Hz."""
    slow, fast = (approaching(0.0, rate_hz, noise_stds=1.0).deviation_mps for rate_hz in (5.0, 20.0))
    assert fast == pytest.approx(slow, rel=0.25)
