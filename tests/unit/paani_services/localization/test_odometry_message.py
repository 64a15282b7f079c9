"""The error ellipse that odometry states, from the covariance of its filter."""

import math

import numpy as np
import pytest

from paani.messages import Odometry
from paani_services.localization.odometry_message import error_ellipse, odometry_of, with_position_std
from paani_services.localization.planar_filter import PX, PY, SIZE, PlanarFilter


@pytest.mark.parametrize("direction_rad", [-1.2, 0.0, 0.4, 1.5])
def test_the_ellipse_lies_along_the_covariance(direction_rad: float) -> None:
    cos, sin = math.cos(direction_rad), math.sin(direction_rad)
    turn = np.array([[cos, -sin], [sin, cos]])
    covariance_m2 = turn @ np.diag([9.0, 1.0]) @ turn.T
    major_std_m, major_rad = error_ellipse(covariance_m2[0, 0], covariance_m2[0, 1], covariance_m2[1, 1])
    assert major_std_m == pytest.approx(3.0)
    assert major_rad == pytest.approx(direction_rad)


def test_odometry_states_the_ellipse_of_its_filter() -> None:
    std = np.zeros(SIZE)
    std[[PX, PY]] = 1.0, 7.0
    odometry = odometry_of(PlanarFilter(np.zeros(SIZE), std), None, 1, healthy=True, stopped=False)
    assert odometry.position_std_m == pytest.approx(5.0)
    assert odometry.position_major_std_m == pytest.approx(7.0)
    assert abs(odometry.position_major_rad) == pytest.approx(math.pi / 2)


def test_an_error_that_grows_alike_in_all_directions_rounds_the_ellipse() -> None:
    before = Odometry(
        source_us=1, x_m=0.0, y_m=0.0, yaw_rad=0.0, surge_mps=0.0, position_std_m=5.0,
        position_major_std_m=7.0, position_major_rad=0.5,
    )  # fmt: skip
    after = with_position_std(before, 13.0)
    assert (after.position_std_m, after.position_major_rad) == (13.0, 0.5)
    assert after.position_major_std_m == pytest.approx(math.sqrt(49.0 + 144.0))
