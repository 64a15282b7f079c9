"""The planar filter: Jacobians, angles, gates."""

import math

import numpy as np
import pytest

from paani_services.localization.filter import OWN, PSI, PX, PY, SIZE, PlanarFilter, U, V

STD = np.array([1.0, 1.0, 0.1, 0.2, 0.1, 0.005, 0.8, 0.8, 0.05, 0.3, 0.3])

OWN_STD = np.array([*STD[:OWN], *[0.0] * (SIZE - OWN)])


def state(*first: float) -> np.ndarray:
    """The first states, zero for the rest."""
    return np.array([*first, *[0.0] * (SIZE - len(first))])


def propagated(x: np.ndarray, step_s: float = 0.05) -> np.ndarray:
    one = PlanarFilter(x, STD)
    one.predict(0.3, 0.2, -0.1, step_s)
    return one.x.copy()


def test_prediction_follows_a_circle() -> None:
    """1 m/s and 0.5 rad/s for one full turn comes back to where it began."""
    one = PlanarFilter(state(0.0, 0.0, 0.0, 1.0, 0.0, 0.1), STD)
    steps = round(4.0 * math.pi / 0.001)
    for _ in range(steps):
        one.predict(0.6, 0.0, -0.0 + 0.5 * 1.0, 0.001)
    assert one.x[[PX, PY]] == pytest.approx([0.0, 0.0], abs=0.01)
    assert one.x[[U, V]] == pytest.approx([1.0, 0.0], abs=1e-3)


def test_prediction_jacobian_matches_differences() -> None:
    """The covariance is carried by F P F' + Q with F the derivative of the prediction itself."""
    x = state(3.0, -2.0, 0.7, 0.5, 0.05, 0.01, 1.0, -0.5, 0.03, 0.2, -0.1)
    numeric = np.zeros((SIZE, SIZE))
    for column in range(SIZE):
        delta = np.zeros(SIZE)
        delta[column] = 1e-6
        numeric[:, column] = (propagated(x + delta) - propagated(x - delta)) / 2e-6
    one = PlanarFilter(x, STD)
    quiet = PlanarFilter(x, np.full(SIZE, 1e-12))
    one.predict(0.3, 0.2, -0.1, 0.05)
    quiet.predict(0.3, 0.2, -0.1, 0.05)
    carried = numeric @ PlanarFilter(x, STD).covariance @ numeric.T
    assert np.allclose(one.covariance - quiet.covariance, carried, rtol=1e-6, atol=1e-11)


def test_yaw_is_corrected_the_short_way_round() -> None:
    one = PlanarFilter(state(0.0, 0.0, math.pi - 0.05), STD)
    assert one.correct_yaw(-math.pi + 0.05, 0.1, gate2=25.0).taken
    assert abs(one.x[PSI]) == pytest.approx(math.pi, abs=0.01)


def test_outlier_is_refused_and_changes_nothing() -> None:
    one = PlanarFilter(np.zeros(SIZE), STD)
    before = one.x.copy()
    assert not one.correct_position(60.0, 0.0, 0.8, gate2=25.0).taken
    assert (one.x == before).all()
    assert one.correct_position(2.0, 0.0, 0.8, gate2=25.0).taken
    assert 0.0 < one.x[PX] < 2.0


def test_velocity_correction_in_map_axes() -> None:
    """Heading north, moving north: surge, not sway."""
    one = PlanarFilter(state(0.0, 0.0, math.pi / 2.0), OWN_STD)
    for _ in range(50):
        one.correct_velocity(0.0, 0.4, 0.05, gate2=1e9)
    assert one.x[[U, V]] == pytest.approx([0.4, 0.0], abs=0.02)
