"""Two estimates from GPS and IMU (L1-L5), and when they may be believed."""

import math
import statistics

import msgspec
import numpy as np
import pytest

from paani.config import LocalizationConfig
from paani.geometry import geodetic_from_enu
from paani.messages import GpsFix, ImuSample, Odometry
from paani_services.localization.calibration import UNCALIBRATED_STD_RADPS, gyro_bias
from paani_services.localization.estimator import Estimator

ORIGIN_DEG = (50.0, 8.0)
CONFIG = LocalizationConfig(origin_lat_lon_deg=ORIGIN_DEG)
START_US = 5_000_000
BIAS_RADPS = 0.004


class Ride:
    """A boat at constant speed and yaw rate, its sensors, and the estimator at 20 Hz."""

    def __init__(self, config: LocalizationConfig = CONFIG, seed: int = 1) -> None:
        self.estimator = Estimator(config)
        self.rng = np.random.default_rng(seed)
        self.now_us = START_US
        self.x_m, self.y_m, self.yaw_rad = 20.0, -10.0, 0.5
        self.gps = self.imu = True
        self.fix_offset_m = 0.0
        self.epoch = 0
        self.local = self.glob = Odometry(source_us=0, x_m=0, y_m=0, yaw_rad=0, surge_mps=0)

    def go(self, seconds: float, surge_mps: float = 0.0, yaw_rate_radps: float = 0.0) -> list[Odometry]:
        found = []
        for step in range(round(seconds * 20)):
            samples = [self._sample(surge_mps, yaw_rate_radps) for _ in range(5)]
            fix = self._fix(surge_mps) if step % 4 == 0 and self.gps else None
            self.local, self.glob = self.estimator.step(samples if self.imu else [], fix, self.now_us)
            found.append(self.glob)
        return found

    def _sample(self, surge_mps: float, yaw_rate_radps: float) -> ImuSample:
        self.now_us += 10_000
        self.yaw_rad += yaw_rate_radps * 0.01
        self.x_m += surge_mps * math.cos(self.yaw_rad) * 0.01
        self.y_m += surge_mps * math.sin(self.yaw_rad) * 0.01
        noise = self.rng.standard_normal(4)
        return ImuSample(
            source_us=self.now_us,
            epoch=self.epoch,
            gyro_x_radps=0.0,
            gyro_y_radps=0.0,
            gyro_z_radps=yaw_rate_radps + BIAS_RADPS + 0.002 * noise[0],
            accel_x_mps2=0.03 * noise[1],
            accel_y_mps2=surge_mps * yaw_rate_radps + 0.03 * noise[2],
            accel_z_mps2=9.81,
            orientation_available=True,
            yaw_rad=self.yaw_rad + 0.01 * noise[3],
        )

    def _fix(self, surge_mps: float) -> GpsFix:
        noise = self.rng.standard_normal(4)
        latitude_deg, longitude_deg = geodetic_from_enu(
            self.x_m + self.fix_offset_m + 0.3 * noise[0], self.y_m + 0.3 * noise[1], *ORIGIN_DEG
        )
        vx = surge_mps * math.cos(self.yaw_rad) + 0.05 * noise[2]
        vy = surge_mps * math.sin(self.yaw_rad) + 0.05 * noise[3]
        return GpsFix(
            source_us=self.now_us,
            latitude_deg=latitude_deg,
            longitude_deg=longitude_deg,
            sog_mps=math.hypot(vx, vy),
            cog_rad=math.atan2(vy, vx),
            position_std_m=0.8,
        )


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


def test_a_receiver_that_jumps_is_doubted_then_followed(ride: Ride) -> None:
    ride.fix_offset_m = 80.0
    ride.go(1.0)
    assert not ride.glob.healthy
    assert ride.glob.x_m == pytest.approx(ride.x_m, abs=2.0)
    ride.go(4.0)
    assert ride.glob.healthy
    assert ride.glob.x_m == pytest.approx(ride.x_m + 80.0, abs=1.0)


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
            ride._sample(0.0, 0.0),
            roll_rad=roll_rad,
            pitch_rad=pitch_rad,
            accel_x_mps2=-9.81 * math.sin(pitch_rad),
            accel_y_mps2=9.81 * math.sin(roll_rad) * math.cos(pitch_rad),
        )
        local, _ = ride.estimator.step([tilted], None, ride.now_us)
        assert math.hypot(local.surge_mps, local.sway_mps) < 0.05


def test_calibration_refuses_a_boat_that_turns() -> None:
    boat = Ride()
    turning = [boat._sample(0.5, 0.1) for _ in range(200)]
    assert gyro_bias(turning).radps == 0.0
    assert gyro_bias(turning).std_radps == UNCALIBRATED_STD_RADPS
    resting = [boat._sample(0.0, 0.0) for _ in range(200)]
    assert gyro_bias(resting).radps == pytest.approx(BIAS_RADPS, abs=5e-4)


def test_a12_without_heading_there_is_no_health() -> None:
    """A12: an IMU that marks its orientation unavailable gives no yaw to steer by."""
    boat = Ride()
    sample = boat._sample
    boat._sample = lambda *motion: msgspec.structs.replace(  # type: ignore[method-assign]
        sample(*motion), orientation_available=False
    )
    assert not any(one.healthy for one in boat.go(6.0))


def test_first_fix_is_the_origin_when_none_is_set() -> None:
    boat = Ride(LocalizationConfig())
    boat.go(4.0)
    assert math.hypot(boat.glob.x_m, boat.glob.y_m) < 1.5
