"""GPS, IMU and compass errors (K9)."""

import math
import statistics

import numpy as np
import pytest

from paani.config import PlantConfig, SensorsConfig
from paani.geometry import enu_from_geodetic
from paani_sim.plant.plant import Plant
from paani_sim.plant.sensors import Truth, initial_errors, measure_gps, measure_imu
from paani_sim.plant.telemetry import gps_message, imu_message
from paani_sim.worlds import load_world

CONFIG = SensorsConfig()
ORIGIN_DEG = (47.65, 9.48)
TRUTH = Truth(12.0, -5.0, 0.3, 0.4, 0.01, -0.02, 1.5, (0.0, 0.0, 0.1), (0.0, 0.0, 9.81))


def gps_errors_m(count: int, seed: int) -> list[float]:
    rng = np.random.default_rng(seed)
    errors = initial_errors(CONFIG, rng)
    found = []
    for _ in range(count):
        errors, fix = measure_gps(errors, TRUTH, ORIGIN_DEG, CONFIG, rng)
        found.append(enu_from_geodetic(fix.latitude_deg, fix.longitude_deg, *ORIGIN_DEG)[0] - 12.0)
    return found


@pytest.mark.slow
def test_k9_gps_error_wanders() -> None:
    """Neighbouring fixes share their error; over many minutes it has the stated spread."""
    found = gps_errors_m(60_000, seed=3)
    neighbours = statistics.correlation(found[:-1], found[1:])
    assert neighbours > 0.98
    assert statistics.pstdev(found) == pytest.approx(0.8, rel=0.2)


def test_gps_velocity_over_ground() -> None:
    rng = np.random.default_rng(1)
    errors = initial_errors(CONFIG, rng)
    fixes = [measure_gps(errors, TRUTH, ORIGIN_DEG, CONFIG, rng)[1] for _ in range(500)]
    east = statistics.fmean(fix.sog_mps * math.cos(fix.cog_rad) for fix in fixes)
    north = statistics.fmean(fix.sog_mps * math.sin(fix.cog_rad) for fix in fixes)
    assert (east, north) == pytest.approx((0.3, 0.4), abs=0.01)


def test_l5_speed_is_not_zero_at_rest() -> None:
    """L5: the receiver reports way on a boat that lies still."""
    rng = np.random.default_rng(1)
    still = TRUTH._replace(vx_mps=0.0, vy_mps=0.0)
    _, fix = measure_gps(initial_errors(CONFIG, rng), still, ORIGIN_DEG, CONFIG, rng)
    assert fix.sog_mps > 0.0


@pytest.mark.slow
def test_imu_bias_is_constant_and_noise_is_not() -> None:
    rng = np.random.default_rng(2)
    errors = initial_errors(CONFIG, rng)
    samples = [measure_imu(errors, TRUTH, CONFIG, rng) for _ in range(2000)]
    rate = [sample.rates_radps[2] - 0.1 for sample in samples]
    assert statistics.fmean(rate) == pytest.approx(errors.gyro_radps[2], abs=2e-4)
    assert statistics.pstdev(rate) == pytest.approx(CONFIG.gyro_noise_radps, rel=0.1)
    yaw = statistics.fmean(sample.yaw_rad for sample in samples)
    assert yaw - 1.5 == pytest.approx(errors.compass_rad, abs=1e-3)


def test_k9_every_value_has_an_error_of_its_own() -> None:
    rng = np.random.default_rng(5)
    errors = initial_errors(CONFIG, rng)
    fixes, samples = [], []
    for _ in range(400):
        errors, fix = measure_gps(errors, TRUTH, ORIGIN_DEG, CONFIG, rng)
        east_m, north_m = enu_from_geodetic(fix.latitude_deg, fix.longitude_deg, *ORIGIN_DEG)
        velocity = (fix.sog_mps * math.cos(fix.cog_rad), fix.sog_mps * math.sin(fix.cog_rad))
        fixes.append((east_m - errors.gps_x_m, north_m - errors.gps_y_m, *velocity))
        imu = measure_imu(errors, TRUTH, CONFIG, rng)
        angles = (imu.roll_rad, imu.pitch_rad, imu.yaw_rad - errors.compass_rad)
        samples.append((*imu.rates_radps, *imu.specific_force_mps2, *angles))
    of_fix = [CONFIG.gps_white_std_m] * 2 + [CONFIG.gps_speed_std_mps] * 2
    of_sample = [CONFIG.gyro_noise_radps] * 3 + [CONFIG.accel_noise_mps2] * 3
    of_sample += [CONFIG.tilt_noise_rad] * 2 + [CONFIG.compass_noise_rad]
    for values, std in zip([*zip(*fixes, strict=True), *zip(*samples, strict=True)], of_fix + of_sample, strict=True):
        assert statistics.pstdev(values) == pytest.approx(std, rel=0.15)
    for values, rate, bias in zip(zip(*samples, strict=True), TRUTH.rates_radps, errors.gyro_radps, strict=False):
        assert statistics.fmean(values) - rate == pytest.approx(bias, abs=0.2 * CONFIG.gyro_noise_radps)
    assert all(abs(bias) > 0.0 for bias in (*errors.gyro_radps, errors.compass_rad))


def test_k9_what_is_sent_is_no_truth() -> None:
    world = load_world("lake")
    plant = Plant(world, PlantConfig(), 1)
    try:
        plant.place(3.0, 4.0, 0.5)
        origin_deg = (world.origin_lat_deg, world.origin_lon_deg)
        for _ in range(3):
            fix = gps_message(plant, 1)
            east_m, north_m = enu_from_geodetic(fix.latitude_deg, fix.longitude_deg, *origin_deg)
            assert min(abs(east_m - 3.0), abs(north_m - 4.0)) > 1e-3
        imu, truth = imu_message(plant, 1), plant.attitude
        assert imu.yaw_rad != pytest.approx(truth.yaw_rad, abs=1e-6)
        assert imu.roll_rad != pytest.approx(truth.roll_rad, abs=1e-6)
        assert imu.gyro_z_radps != 0.0
    finally:
        plant.close()


def test_seed_decides_everything() -> None:
    assert gps_errors_m(20, seed=4) == gps_errors_m(20, seed=4)
    assert gps_errors_m(20, seed=4) != gps_errors_m(20, seed=5)
