"""L5: rest is detected although a receiver at a quay shows speed, and it ends when the boat leaves."""

import itertools
import math
from collections import Counter
from collections.abc import Iterator

import msgspec
import numpy as np
import pytest

from paani.config import LocalizationConfig
from paani.geometry import enu_from_geodetic
from paani.messages import GpsFix, ImuSample, Odometry
from paani_services.localization.estimator import Estimator
from paani_services.sensors.fixes import fixes_from_sentences
from tests.places import DATA
from tests.unit.paani_services.localization.estimated_boat import EstimatedBoat, wandering

LOGS = DATA / "logs"


def speed_mps(estimate: Odometry) -> float:
    return math.hypot(estimate.surge_mps, estimate.sway_mps)


def longest(flags: list[bool]) -> int:
    return max((len(list(run)) for flag, run in itertools.groupby(flags) if flag), default=0)


def at_quay(fixes: list[GpsFix], *, tilt_mps2: float, seed: int = 1) -> Iterator[tuple[Odometry, GpsFix | None]]:
    """Estimates from recorded fixes and a simulated IMU at rest, from the first fix on; and each fix in its turn."""
    estimator, rng, waiting = Estimator(LocalizationConfig()), np.random.default_rng(seed), list(reversed(fixes))
    now_us = fixes[0].source_us - 3_000_000
    while waiting:
        samples = []
        for noise in rng.standard_normal((5, 5)).tolist():
            now_us += 10_000
            samples.append(
                ImuSample(
                    source_us=now_us,
                    gyro_x_radps=0.002 * noise[0],
                    gyro_y_radps=0.0,
                    gyro_z_radps=0.004 + 0.002 * noise[1],
                    accel_x_mps2=tilt_mps2 + 0.03 * noise[2],
                    accel_y_mps2=0.03 * noise[3],
                    accel_z_mps2=9.81,
                    orientation_available=True,
                    yaw_rad=1.0 + 0.01 * noise[4],
                )
            )
        fix = waiting.pop() if waiting[-1].source_us <= now_us else None
        _, estimate = estimator.step(samples, fix, now_us)
        if fix is not None or len(waiting) < len(fixes):
            yield estimate, fix


@pytest.mark.rotating(cpu_s=10)
@pytest.mark.data
@pytest.mark.skipif(not LOGS.is_dir(), reason=f"no logs at {LOGS}; set PAANI_DATA")
def test_l5_a_recorded_moored_boat_is_not_read_as_motion() -> None:
    """L5: of ten minutes at a dock, with over 0.05 m/s in 93 % of the fixes, 2 % at most are read as motion.

    The IMU is mounted askew by 0.3 degrees.
    """
    fixes = list(fixes_from_sentences((LOGS / "gps_moored.nmea").read_text("ascii").splitlines(), Counter()))
    assert sum(fix.sog_mps > 0.05 for fix in fixes) > 0.9 * len(fixes)
    estimates = list(at_quay(fixes, tilt_mps2=0.05))
    moving = [speed_mps(each) > 0.05 for each, _ in estimates]
    assert sum(moving) < 0.02 * len(moving)
    assert longest(moving) < 6 * 20
    assert sum(each.stopped for each, _ in estimates) > 0.97 * len(estimates)
    offs = []
    for each, fix in estimates:
        if fix is not None:
            x_m, y_m = enu_from_geodetic(fix.latitude_deg, fix.longitude_deg, each.latitude_deg, each.longitude_deg)
            offs.append(max(abs(x_m), abs(y_m)) / each.position_std_m)
    assert np.quantile(offs, 0.95) < 2.5  # the stated spread covers the wander
    assert max(offs) < 3.5


def noisy(std_m: float, speed_mps: float, seed: int = 1) -> EstimatedBoat:
    """A boat with a receiver of 1 Hz and this standard deviation."""
    return EstimatedBoat(
        seed=seed,
        wander_m=std_m,
        fix_noise_m=0.1 * std_m,
        fix_speed_noise_mps=speed_mps,
        fix_std_m=std_m,
        steps_per_fix=20,
    )


def test_l5_noise_of_gps_speed_is_no_motion_at_rest() -> None:
    """L5: with 0.3 m/s of noise the filter alone would never be at rest."""
    boat = noisy(5.0, 0.3)
    estimates = boat.sail(120.0)[200:]
    assert all(each.stopped for each in estimates)
    assert max(map(speed_mps, estimates)) < 0.05


def test_the_simulators_receiver_shows_no_motion_at_rest() -> None:
    estimates = wandering().sail(150.0)[200:]
    moving = [speed_mps(each) > 0.05 for each in estimates]
    assert sum(moving) < 0.02 * len(moving)
    assert longest(moving) < 2 * 20


@pytest.mark.parametrize("poor", [False, True])
@pytest.mark.parametrize("surge_mps", [0.15, 0.6])
def test_rest_ends_within_two_seconds_when_the_boat_sets_off(poor: bool, surge_mps: float) -> None:
    """The IMU measures the start, even of a boat as slow as the paper's cruise."""
    boat = noisy(5.0, 0.3) if poor else wandering()
    boat.sail(30.0)
    boat.sail(2.0, surge_mps=surge_mps)
    estimates = boat.sail(20.0, surge_mps=surge_mps)
    assert not any(each.stopped for each in estimates)
    assert speed_mps(estimates[-1]) > 0.5 * surge_mps


def test_rest_ends_for_a_boat_that_drifts_off_too_slowly_for_its_imu() -> None:
    boat = wandering()
    boat.sail(30.0)
    for step in range(1, 21):
        boat.sail(2.0, surge_mps=0.01 * step)  # 0.005 m/s^2
    assert boat.global_estimate.surge_mps > 0.1
    assert not boat.global_estimate.stopped
    assert boat.error_m() < 3.0


def test_steady_slow_motion_is_never_taken_for_rest() -> None:
    """Half the paper's cruise, begun during the calibration of the gyro: the IMU measures nothing for minutes."""
    boat = wandering()
    boat.sail(15.0, surge_mps=0.075)
    estimates = boat.sail(120.0, surge_mps=0.075)
    assert sum(each.stopped for each in estimates) == 0
    assert boat.error_m() < 2.5


def test_rest_is_found_again_after_a_voyage() -> None:
    boat = wandering()
    boat.sail(20.0)
    boat.sail(60.0, surge_mps=0.6)
    estimates = boat.sail(30.0)
    assert estimates[-1].stopped
    assert sum(each.stopped for each in estimates) > 15 * 20


@pytest.mark.rotating(cpu_s=10)
@pytest.mark.slow
@pytest.mark.parametrize(
    ("drift_mps", "imu_gap_s", "seed"), [(0.0, 0.0, 1), (0.02, 0.0, 2), (0.04, 0.0, 3), (0.08, 0.0, 1), (0.04, 1.0, 2)]
)
def test_after_a_voyage_rest_is_rest_in_the_water_that_carries_the_boat(
    drift_mps: float, imu_gap_s: float, seed: int
) -> None:
    """Stopped in a current, it knows within half a metre how far that carried it in a minute, of which no IMU tells."""
    boat = wandering(seed)
    boat.sail(15.0)
    boat.sail(20.0, surge_mps=0.6)
    boat.sail(15.0, surge_mps=drift_mps)
    boat.imu = False
    boat.sail(imu_gap_s, surge_mps=drift_mps)
    boat.imu = True
    boat.sail(20.0, surge_mps=drift_mps)
    estimates = boat.sail(60.0, surge_mps=drift_mps)
    velocity_mps = [complex(each.surge_mps, each.sway_mps) for each in estimates]  # it holds its heading
    assert abs(sum(velocity_mps) / 20.0 - 60.0 * drift_mps) < 0.5


def test_an_imu_without_noise_does_not_keep_rest() -> None:
    """An IMU that repeats one sample is broken, so the receiver decides."""
    boat = wandering()
    boat.sail(30.0)
    frozen = boat.sample(0.0, 0.0)
    boat.change_samples = lambda samples: [
        msgspec.structs.replace(frozen, source_us=each.source_us) for each in samples
    ]
    boat.sail(5.0, surge_mps=0.5)
    estimates = boat.sail(10.0, surge_mps=0.5)
    assert not estimates[-1].stopped or not estimates[-1].healthy
