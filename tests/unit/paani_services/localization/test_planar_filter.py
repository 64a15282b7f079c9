"""The planar filter: Jacobians, angles, validation gates, consistency."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paani.messages import ImuSample
from paani_services.localization.levelling import level_sample
from paani_services.localization.planar_filter import LOCAL_STATES_N, PSI, PX, PY, SIZE, PlanarFilter, U, V

pytestmark = pytest.mark.slow

STD = np.array([1.0, 1.0, 0.1, 0.2, 0.1, 0.005, 0.8, 0.8, 0.05, 0.3, 0.3])

LOCAL_STD = np.array([*STD[:LOCAL_STATES_N], *[0.0] * (SIZE - LOCAL_STATES_N)])


def state(*first: float) -> np.ndarray:
    """The first states, zero for the rest."""
    return np.array([*first, *[0.0] * (SIZE - len(first))])


def propagated(x: np.ndarray, step_s: float = 0.05) -> np.ndarray:
    planar_filter = PlanarFilter(x, STD)
    planar_filter.predict(0.3, 0.2, -0.1, step_s)
    return planar_filter.x.copy()


def test_prediction_follows_a_circle() -> None:
    """At 1 m/s and 0.5 rad/s planar_filter full circle ends where it began."""
    planar_filter = PlanarFilter(state(0.0, 0.0, 0.0, 1.0, 0.0, 0.1), STD)
    steps = round(4.0 * math.pi / 0.001)
    for _ in range(steps):
        planar_filter.predict(0.6, 0.0, -0.0 + 0.5 * 1.0, 0.001)
    assert planar_filter.x[[PX, PY]] == pytest.approx([0.0, 0.0], abs=0.01)
    assert planar_filter.x[[U, V]] == pytest.approx([1.0, 0.0], abs=1e-3)


def test_prediction_jacobian_matches_differences() -> None:
    """The covariance is carried by F P F' + Q with F the derivative of the prediction itself."""
    x = state(3.0, -2.0, 0.7, 0.5, 0.05, 0.01, 1.0, -0.5, 0.03, 0.2, -0.1)
    numeric = np.zeros((SIZE, SIZE))
    for column in range(SIZE):
        delta = np.zeros(SIZE)
        delta[column] = 1e-6
        numeric[:, column] = (propagated(x + delta) - propagated(x - delta)) / 2e-6
    planar_filter = PlanarFilter(x, STD)
    quiet = PlanarFilter(x, np.full(SIZE, 1e-12))
    planar_filter.predict(0.3, 0.2, -0.1, 0.05)
    quiet.predict(0.3, 0.2, -0.1, 0.05)
    carried = numeric @ PlanarFilter(x, STD).covariance @ numeric.T
    assert np.allclose(planar_filter.covariance - quiet.covariance, carried, rtol=1e-6, atol=1e-11)


def test_yaw_is_corrected_the_short_way_round() -> None:
    planar_filter = PlanarFilter(state(0.0, 0.0, math.pi - 0.05), STD)
    assert planar_filter.correct_yaw(-math.pi + 0.05, 0.1, gate2=25.0).is_accepted
    assert abs(planar_filter.x[PSI]) == pytest.approx(math.pi, abs=0.01)


def test_an_outlier_outside_the_validation_gate_changes_nothing() -> None:
    planar_filter = PlanarFilter(np.zeros(SIZE), STD)
    before = planar_filter.x.copy()
    assert not planar_filter.correct_position(60.0, 0.0, 0.8, gate2=25.0).is_accepted
    assert (planar_filter.x == before).all()
    assert planar_filter.correct_position(2.0, 0.0, 0.8, gate2=25.0).is_accepted
    assert 0.0 < planar_filter.x[PX] < 2.0


def test_velocity_correction_in_map_axes() -> None:
    """Heading north, moving north: surge, not sway."""
    planar_filter = PlanarFilter(state(0.0, 0.0, math.pi / 2.0), LOCAL_STD)
    for _ in range(50):
        planar_filter.correct_velocity(0.0, 0.4, 0.05, gate2=1e9)
    assert planar_filter.x[[U, V]] == pytest.approx([0.4, 0.0], abs=0.02)


def test_the_receivers_slow_error_is_not_taken_for_motion() -> None:
    """Fixes that wander by their stated standard deviation move a boat at rest by far less."""
    rng, planar_filter = np.random.default_rng(3), PlanarFilter(state(), STD)
    planar_filter.reset_position(0.0, 0.0, 0.8, 0.05)
    keep, error = math.exp(-0.2 / 60.0), 0.8 * rng.standard_normal(2)
    places = []
    for _ in range(1500):
        error = keep * error + 0.8 * math.sqrt(1.0 - keep**2) * rng.standard_normal(2)
        planar_filter.predict(0.0, 0.0, 0.0, 0.2, 0.8)
        planar_filter.correct_velocity(0.0, 0.0, 0.03, math.inf, is_course_known=False)
        fix = error + 0.05 * rng.standard_normal(2)
        planar_filter.correct_position(float(fix[0]), float(fix[1]), 0.05, 25.0)
        places.append(planar_filter.x[[PX, PY]])
    assert np.std(np.array(places[300:]), axis=0).max() < 0.3


def test_position_errors_are_as_large_as_the_covariance_says() -> None:
    """NEES: over forty receivers, the mean of e' P^-1 e is 2 by its 95 % band."""
    rng, found = np.random.default_rng(5), []
    keep, std = math.exp(-0.2 / 60.0), np.array([1.0, 1.0, 0.02, 0.05, 0.05, 0.001, 0.8, 0.8, 0.02, 0.0, 0.0])
    for _ in range(40):
        error = 0.8 * rng.standard_normal(2)
        planar_filter = PlanarFilter(state(0.0, 0.0, 0.4, 0.6), std)
        truth = np.zeros(2)
        first = truth + error + 0.05 * rng.standard_normal(2)
        planar_filter.reset_position(float(first[0]), float(first[1]), 0.8, 0.05)
        for _ in range(300):
            truth = truth + 0.2 * 0.6 * np.array([math.cos(0.4), math.sin(0.4)])
            error = keep * error + 0.8 * math.sqrt(1.0 - keep**2) * rng.standard_normal(2)
            planar_filter.predict(0.0, 0.0, 0.0, 0.2, 0.8)
            velocity = 0.6 * np.array([math.cos(0.4), math.sin(0.4)]) + 0.05 * rng.standard_normal(2)
            fix = truth + error + 0.05 * rng.standard_normal(2)
            planar_filter.correct_velocity(float(velocity[0]), float(velocity[1]), 0.05, math.inf)
            planar_filter.correct_position(float(fix[0]), float(fix[1]), 0.05, math.inf)
        error_m = planar_filter.x[[PX, PY]] - truth
        found.append(float(error_m @ np.linalg.solve(planar_filter.covariance[:2, :2], error_m)))
    assert np.mean(found) == pytest.approx(2.0, abs=1.96 * math.sqrt(4.0 / len(found)))


def test_the_covariance_stays_symmetric_and_positive_over_a_long_run() -> None:
    rng, planar_filter = np.random.default_rng(7), PlanarFilter(state(), STD)
    for step in range(3_000):
        planar_filter.predict(0.3 * math.sin(0.01 * step), 0.1, 0.05, 0.05, 0.8)
        planar_filter.correct_yaw(float(planar_filter.x[PSI]) + 0.02 * rng.standard_normal(), 0.02, 9.0)
        planar_filter.correct_sideslip(1.4)
        if step % 4 == 0:
            x_m, y_m, _ = planar_filter.predicted_fix
            planar_filter.correct_position(x_m + 0.05 * rng.standard_normal(), y_m, 0.05, 25.0)
            planar_filter.correct_velocity(*planar_filter.velocity, 0.05, 25.0)
    assert (planar_filter.covariance == planar_filter.covariance.T).all()
    assert np.linalg.eigvalsh(planar_filter.covariance).min() > 0.0
    assert np.isfinite(planar_filter.x).all()
    assert planar_filter.std.max() < 2.0


@given(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(-2.0, 2.0))
def test_levelling_removes_gravity_from_a_tilted_imu(roll_rad: float, pitch_rad: float, turn_radps: float) -> None:
    """A boat that lies still, or turns, however it heels and trims."""
    sin_roll, cos_roll, sin_pitch, cos_pitch = (
        math.sin(roll_rad), math.cos(roll_rad), math.sin(pitch_rad), math.cos(pitch_rad)
    )  # fmt: skip
    motion = level_sample(
        ImuSample(
            source_us=0,
            gyro_x_radps=-turn_radps * sin_pitch,
            gyro_y_radps=turn_radps * cos_pitch * sin_roll,
            gyro_z_radps=turn_radps * cos_pitch * cos_roll,
            accel_x_mps2=-9.81 * sin_pitch,
            accel_y_mps2=9.81 * cos_pitch * sin_roll,
            accel_z_mps2=9.81 * cos_pitch * cos_roll,
            roll_rad=roll_rad,
            pitch_rad=pitch_rad,
        )
    )
    assert (motion.ahead_mps2, motion.left_mps2) == pytest.approx((0.0, 0.0), abs=1e-9)
    assert motion.yaw_rate_radps == pytest.approx(turn_radps)
