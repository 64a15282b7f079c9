"""Two estimates from GPS and IMU (L1-L5), and when they may be believed."""

import math
import statistics

import msgspec
import pytest

from paani.config import LocalizationConfig
from paani.geometry import geodetic_from_enu
from paani_services.localization.gyro_bias import UNCALIBRATED_STD_RADPS, estimate_gyro_bias
from tests.unit.paani_services.localization.boat_ride import BIAS_RADPS, ORIGIN_DEG, Ride


@pytest.fixture
def ride() -> Ride:
    boat = Ride()
    boat.go(4.0)
    return boat


def test_l2_l3_follows_the_boat_in_the_map(ride: Ride) -> None:
    """L2, L3: position in the ENU map, heading and speed, along a curve."""
    ride.go(40.0, surge_mps=0.5, yaw_rate_radps=0.05)
    estimate = ride.glob
    assert math.hypot(estimate.x_m - ride.x_m, estimate.y_m - ride.y_m) < 0.4
    assert math.cos(estimate.yaw_rad - ride.yaw_rad) > math.cos(0.03)
    assert estimate.surge_mps == pytest.approx(0.5, abs=0.06)
    assert estimate.yaw_rate_radps == pytest.approx(0.05, abs=0.01)
    here = geodetic_from_enu(estimate.x_m, estimate.y_m, *ORIGIN_DEG)
    assert (estimate.latitude_deg, estimate.longitude_deg) == pytest.approx(here)


def test_l1_local_estimate_is_smooth_and_ignores_gps(ride: Ride) -> None:
    """L1: a jump of the receiver does not reach the local frame."""
    before = ride.local
    ride.fix_offset_m = 3.0
    ride.go(2.0)
    assert math.hypot(ride.local.x_m - before.x_m, ride.local.y_m - before.y_m) < 0.2
    assert ride.local.healthy
    assert ride.local.yaw_rad == pytest.approx(ride.yaw_rad, abs=0.03)


def test_unhealthy_until_calibrated_and_converged() -> None:
    boat = Ride()
    assert not any(one.healthy for one in boat.go(1.9))
    boat.go(1.6)
    assert boat.glob.healthy
    assert boat.glob.position_std_m >= 0.8


def test_no_fix_no_health() -> None:
    boat = Ride()
    boat.gps = False
    assert not any(one.healthy for one in boat.go(6.0))


def test_stale_gps_and_stale_imu_are_unhealthy_and_recover(ride: Ride) -> None:
    ride.gps = False
    ride.go(2.5)
    assert ride.glob.healthy
    ride.go(1.0)
    assert not ride.glob.healthy
    ride.gps = True
    ride.go(0.5)
    assert ride.glob.healthy
    ride.imu = False
    ride.go(0.4)
    assert not ride.glob.healthy
    assert not ride.local.healthy


def test_a_new_imu_epoch_starts_anew(ride: Ride) -> None:
    """A plant that restarts has its boat somewhere else: nothing of the old estimate survives."""
    ride.epoch, ride.x_m = 1, -200.0
    assert not any(one.healthy for one in ride.go(1.9))
    ride.go(2.0)
    assert ride.glob.healthy
    assert ride.glob.x_m == pytest.approx(-200.0, abs=1.0)


def test_single_wild_fix_is_gated(ride: Ride) -> None:
    ride.fix_offset_m = 40.0
    ride.go(0.2)
    ride.fix_offset_m = 0.0
    assert ride.glob.x_m == pytest.approx(ride.x_m, abs=1.0)
    assert ride.glob.healthy


def test_l5_stopped_flag(ride: Ride) -> None:
    """L5: set after 2 s below 0.05 m/s, cleared at once by way on."""
    ride.go(6.0)
    assert ride.glob.stopped
    ride.go(3.0, surge_mps=0.4)
    assert not ride.glob.stopped


def test_gyro_bias_is_learnt_at_rest(ride: Ride) -> None:
    rates = [one.yaw_rate_radps for one in ride.go(2.0)]
    assert statistics.fmean(rates) == pytest.approx(0.0, abs=6e-4)


@pytest.mark.parametrize(("roll_rad", "pitch_rad"), [(0.05, 0.0), (0.0, 0.05), (-0.04, 0.06)])
def test_tilt_is_not_taken_for_acceleration(ride: Ride, roll_rad: float, pitch_rad: float) -> None:
    """A boat at rest that heels or trims feels gravity along its axes, and stays at rest."""
    for _ in range(40):
        tilted = msgspec.structs.replace(
            ride.sample(0.0, 0.0),
            roll_rad=roll_rad,
            pitch_rad=pitch_rad,
            accel_x_mps2=-9.81 * math.sin(pitch_rad),
            accel_y_mps2=9.81 * math.sin(roll_rad) * math.cos(pitch_rad),
        )
        local, _ = ride.estimator.step([tilted], None, ride.now_us)
        assert math.hypot(local.surge_mps, local.sway_mps) < 0.05


def test_calibration_refuses_a_boat_that_turns() -> None:
    boat = Ride()
    turning = [boat.sample(0.5, 0.1) for _ in range(200)]
    assert estimate_gyro_bias(turning).radps == 0.0
    assert estimate_gyro_bias(turning).std_radps == UNCALIBRATED_STD_RADPS
    resting = [boat.sample(0.0, 0.0) for _ in range(200)]
    assert estimate_gyro_bias(resting).radps == pytest.approx(BIAS_RADPS, abs=5e-4)


def test_a12_without_heading_there_is_no_health() -> None:
    """A12: an IMU that marks its orientation unavailable gives no yaw to steer by."""
    boat = Ride()
    boat.change = lambda samples: [msgspec.structs.replace(each, orientation_available=False) for each in samples]
    assert not any(one.healthy for one in boat.go(6.0))
    assert not any(one.healthy for one in boat.go(60.0, surge_mps=0.6))


def test_a12_a_compass_that_falls_silent_ends_health(ride: Ride) -> None:
    """A12: the gyro keeps the heading for 3 s, no longer."""
    ride.go(10.0, surge_mps=0.6)
    ride.change = lambda samples: [msgspec.structs.replace(each, orientation_available=False) for each in samples]
    said = ride.go(5.0, surge_mps=0.6)
    assert said[50].healthy
    assert not any(one.healthy for one in said[62:])


def test_first_fix_is_the_origin_when_none_is_set() -> None:
    boat = Ride(LocalizationConfig())
    boat.go(4.0)
    assert math.hypot(boat.glob.x_m, boat.glob.y_m) < 1.5
