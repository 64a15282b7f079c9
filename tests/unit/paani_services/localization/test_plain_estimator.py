"""The paper's filters: they follow the boat, believe their sensors, and say when those fall silent (L1, L3, L5)."""

from __future__ import annotations

import math

import msgspec
import pytest

from paani.config import LocalizationConfig, load_config
from paani.messages import ImuSample
from paani_services.localization.choice import create_estimator
from paani_services.localization.estimator import Estimator
from paani_services.localization.plain_estimator import PlainEstimator
from tests.unit.paani_services.localization.estimated_boat import CONFIG, EstimatedBoat, shifted, wandering

PLAIN = msgspec.structs.replace(CONFIG, ekf="plain")


def test_l3_the_paper_profile_has_the_plain_filters_and_no_other_has() -> None:
    """L3: by the switch `localization.ekf`."""
    assert isinstance(create_estimator(load_config(profile="paper").localization), PlainEstimator)
    assert isinstance(create_estimator(load_config().localization), Estimator)
    others = [load_config(profile=name).localization.ekf for name in ("paani", "wide", "fans", "hil", "hull")]
    assert set(others) == {"augmented"}


@pytest.fixture
def boat() -> EstimatedBoat:
    boat = EstimatedBoat(PLAIN)
    boat.sail(4.0)
    return boat


@pytest.mark.slow
def test_l3_position_of_gps_and_heading_of_the_imu(boat: EstimatedBoat) -> None:
    """L3: along a curve; the speed is that of the fixes' positions, for none is measured."""
    boat.sail(40.0, surge_mps=0.5, yaw_rate_radps=0.05)
    estimate = boat.global_estimate
    assert boat.error_m() < 0.8
    assert math.cos(estimate.yaw_rad - boat.yaw_rad) > math.cos(0.05)
    assert estimate.surge_mps == pytest.approx(0.5, abs=0.15)
    assert estimate.healthy
    assert 0.0 < estimate.nis < 20.0


@pytest.mark.slow
def test_l3_without_speed_over_ground_the_estimate_is_the_same(boat: EstimatedBoat) -> None:
    """L3: of a fix the position alone is used."""
    other = EstimatedBoat(PLAIN)
    other.change_fix = lambda fix: msgspec.structs.replace(fix, sog_mps=9.0, cog_rad=1.0)
    other.sail(4.0)
    assert (other.global_estimate.x_m, other.global_estimate.surge_mps) == (
        boat.global_estimate.x_m,
        boat.global_estimate.surge_mps,
    )


@pytest.mark.slow
def test_l3_a_compass_that_is_off_turns_the_estimate_by_as_much(boat: EstimatedBoat) -> None:
    boat.compass_bias_rad = 0.3
    boat.sail(5.0, surge_mps=0.5)
    assert boat.global_estimate.yaw_rad - boat.yaw_rad == pytest.approx(0.3, abs=0.05)


@pytest.mark.slow
def test_a_receiver_that_jumps_is_followed_and_believed(boat: EstimatedBoat) -> None:
    """What the augmented filter refuses: the paper's has no gate."""
    ours = EstimatedBoat(CONFIG)
    ours.sail(4.0)
    for each in (boat, ours):
        each.fix_offset_m = 8.0
        each.sail(1.0)
    assert boat.error_m() > 3.0
    assert boat.global_estimate.healthy
    assert ours.error_m() < 1.0
    assert not ours.global_estimate.healthy


@pytest.mark.slow
def test_l5_a_boat_at_rest_seems_to_move_as_its_receivers_error_does() -> None:
    """L5: with the simulator's receiver, where the augmented filter finds rest."""
    moving = []
    for config in (PLAIN, CONFIG):
        at_rest = wandering(config=config)
        at_rest.sail(6.0)
        speeds_mps = [math.hypot(one.surge_mps, one.sway_mps) for one in at_rest.sail(20.0)]
        moving.append(sum(speed > 0.05 for speed in speeds_mps) / len(speeds_mps))
    assert moving[0] > 0.2
    assert moving[1] < 0.02


@pytest.mark.slow
def test_l5_the_stopped_flag_follows_the_speed(boat: EstimatedBoat) -> None:
    slow_since_us, flags = None, []
    for estimate in boat.sail(8.0) + boat.sail(5.0, surge_mps=0.5):
        if math.hypot(estimate.surge_mps, estimate.sway_mps) > 0.05:
            slow_since_us = None
        elif slow_since_us is None:
            slow_since_us = estimate.source_us
        assert estimate.stopped is (slow_since_us is not None and estimate.source_us - slow_since_us >= 2_000_000)
        flags.append(estimate.stopped)
    assert not flags[-1]


@pytest.mark.slow
def test_l1_the_local_estimate_has_no_fix_in_it(boat: EstimatedBoat) -> None:
    """L1: neither a jump of the receiver nor its silence reaches it; its heading is the IMU's."""
    silent = EstimatedBoat(PLAIN)
    silent.gps = False
    silent.sail(4.0)
    assert (silent.local_estimate.healthy, silent.global_estimate.healthy) == (True, False)
    boat.fix_offset_m = 3.0
    boat.sail(2.0)
    assert math.hypot(boat.local_estimate.x_m, boat.local_estimate.y_m) < 0.2
    boat.sail(2.0, yaw_rate_radps=0.3)
    assert boat.local_estimate.yaw_rad == pytest.approx(boat.yaw_rad, abs=0.05)


@pytest.mark.slow
def test_what_is_stale_is_unhealthy_until_it_comes_again(boat: EstimatedBoat) -> None:
    assert boat.global_estimate.healthy
    boat.gps = False
    boat.sail(2.5)
    assert boat.global_estimate.healthy
    boat.sail(1.0)
    assert not boat.global_estimate.healthy
    boat.gps = True
    boat.sail(0.5)
    assert not boat.global_estimate.healthy  # five fixes first
    boat.sail(1.0)
    assert boat.global_estimate.healthy
    boat.imu = False
    boat.sail(0.4)
    assert (boat.global_estimate.healthy, boat.local_estimate.healthy) == (False, False)


@pytest.mark.slow
def test_without_a_heading_the_estimate_is_unhealthy(boat: EstimatedBoat) -> None:
    def blind(samples: list[ImuSample]) -> list[ImuSample]:
        return [msgspec.structs.replace(sample, orientation_available=False) for sample in samples]

    boat.change_samples = blind
    boat.sail(2.5)
    assert boat.global_estimate.healthy
    boat.sail(1.0)
    assert not boat.global_estimate.healthy


@pytest.mark.slow
def test_what_is_not_a_number_is_dropped_and_counted(boat: EstimatedBoat) -> None:
    boat.change_fix = lambda fix: msgspec.structs.replace(fix, latitude_deg=math.nan)
    boat.sail(0.4)
    assert boat.estimator.drops["gps_impossible"] == 2
    assert math.isfinite(boat.global_estimate.x_m)
    boat.change_samples = lambda samples: [shifted(sample, 200_000) for sample in samples]
    boat.sail(0.1)
    assert boat.estimator.drops["imu_future"] > 0


@pytest.mark.parametrize("epoch", [0, 1])
@pytest.mark.slow
def test_an_imu_that_restarts_or_a_clock_set_back_starts_everything_anew(boat: EstimatedBoat, epoch: int) -> None:
    boat.epoch, boat.x_m = epoch, -200.0
    if epoch == 0:
        boat.now_us -= 3_000_000
    assert not any(one.healthy for one in boat.sail(0.8))
    boat.sail(1.0)
    assert boat.global_estimate.healthy
    assert boat.global_estimate.x_m == pytest.approx(-200.0, abs=1.5)


@pytest.mark.slow
@pytest.mark.parametrize("config", [PLAIN, CONFIG], ids=["plain", "augmented"])
def test_l1_the_local_speed_is_what_the_accelerometer_adds_up_to(config: LocalizationConfig) -> None:
    boat = EstimatedBoat(config)
    boat.gps = False
    boat.sail(4.0)
    boat.sail(1.0, surge_mps=0.5)
    assert boat.local_estimate.surge_mps == pytest.approx(0.5, abs=0.15)
    assert boat.local_estimate.sway_mps == pytest.approx(0.0, abs=0.05)
