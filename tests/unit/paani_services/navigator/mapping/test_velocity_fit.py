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


def approaching(bearing_rad: float) -> VelocityEstimate:
    """Of a vessel that comes along this bearing at 0.5 m/s."""
    east, north = math.cos(bearing_rad), math.sin(bearing_rad)
    along, across = RAY_STD_M**-2, ACROSS_STD_M**-2
    information = (
        along * east * east + across * north * north,
        (along - across) * east * north,
        along * north * north + across * east * east,
    )
    measurements = []
    for number in range(13):
        at_m = (15.0 - 0.1 * number) * east, (15.0 - 0.1 * number) * north
        outline = (np.array([at_m[0]]), np.array([at_m[1]]))
        measurements.append(
            PositionMeasurement(
                (number * 200_000, 0), Label.VESSEL, at_m, information, 1.0, outline, (True, True), (2.0, 1.0)
            )
        )
    found = fit_velocity(measurements, 2.5)
    assert found is not None
    return found


@given(st.floats(-math.pi, math.pi))
def test_its_deviation_is_that_along_the_line_of_sight_whatever_the_bearing(bearing_rad: float) -> None:
    assert approaching(bearing_rad).deviation_mps == pytest.approx(approaching(0.0).deviation_mps, rel=1e-6)
