"""Two estimates from GPS and IMU (L1-L5), and when they may be believed."""

import math
import statistics
from collections import deque
from collections.abc import Callable

import msgspec
import pytest

from paani.config import LocalizationConfig
from paani.geometry import geodetic_from_enu, wrap_rad
from paani.messages import GpsFix, ImuSample
from paani_services.localization.gyro_bias import UNCALIBRATED_STD_RADPS, estimate_gyro_bias
from tests.unit.paani_services.localization.estimated_boat import BIAS_RADPS, ORIGIN_DEG, EstimatedBoat


def without_orientation(samples: list[ImuSample]) -> list[ImuSample]:
    return [msgspec.structs.replace(sample, orientation_available=False) for sample in samples]


@pytest.fixture
def boat() -> EstimatedBoat:
    boat = EstimatedBoat()
    boat.sail(4.0)
    return boat


@pytest.mark.slow
def test_l2_l3_follows_the_boat_in_the_map(boat: EstimatedBoat) -> None:
    """L2, L3: position in the ENU map, heading and speed, along a curve."""
    boat.sail(40.0, surge_mps=0.5, yaw_rate_radps=0.05)
    estimate = boat.global_estimate
    assert math.hypot(estimate.x_m - boat.x_m, estimate.y_m - boat.y_m) < 0.4
    assert math.cos(estimate.yaw_rad - boat.yaw_rad) > math.cos(0.03)
    assert estimate.surge_mps == pytest.approx(0.5, abs=0.06)
    assert estimate.yaw_rate_radps == pytest.approx(0.05, abs=0.01)
    here = geodetic_from_enu(estimate.x_m, estimate.y_m, *ORIGIN_DEG)
    assert (estimate.latitude_deg, estimate.longitude_deg) == pytest.approx(here)


@pytest.mark.slow
def test_l1_local_estimate_is_smooth_and_ignores_gps(boat: EstimatedBoat) -> None:
    """L1: a jump of the receiver does not reach the local frame; what the gyro measures does, without delay."""
    before = boat.local_estimate
    boat.fix_offset_m = 3.0
    boat.sail(2.0)
    assert math.hypot(boat.local_estimate.x_m - before.x_m, boat.local_estimate.y_m - before.y_m) < 0.2
    assert boat.local_estimate.healthy
    assert boat.local_estimate.yaw_rad == pytest.approx(boat.yaw_rad, abs=0.03)
    boat.sail(4.0, surge_mps=0.5, yaw_rate_radps=0.3)
    assert boat.local_estimate.yaw_rad == pytest.approx(boat.yaw_rad, abs=0.03)


def test_unhealthy_until_calibrated_and_converged() -> None:
    boat = EstimatedBoat()
    assert not any(one.healthy for one in boat.sail(1.9))
    boat.sail(1.6)
    assert boat.global_estimate.healthy
    assert boat.global_estimate.position_std_m >= 0.8


def test_without_fixes_the_estimate_is_unhealthy() -> None:
    boat = EstimatedBoat()
    boat.gps = False
    assert not any(one.healthy for one in boat.sail(6.0))


@pytest.mark.slow
def test_stale_gps_and_stale_imu_are_unhealthy_and_recover(boat: EstimatedBoat) -> None:
    boat.gps = False
    boat.sail(2.5)
    assert boat.global_estimate.healthy
    boat.sail(1.0)
    assert not boat.global_estimate.healthy
    boat.gps = True
    boat.sail(0.5)
    assert boat.global_estimate.healthy
    boat.imu = False
    boat.sail(0.4)
    assert not boat.global_estimate.healthy
    assert not boat.local_estimate.healthy


@pytest.mark.slow
def test_a_new_imu_epoch_starts_anew(boat: EstimatedBoat) -> None:
    """A plant that restarts may have its boat elsewhere: nothing of the old estimate is kept."""
    boat.epoch, boat.x_m = 1, -200.0
    assert not any(one.healthy for one in boat.sail(1.9))
    boat.sail(2.0)
    assert boat.global_estimate.healthy
    assert boat.global_estimate.x_m == pytest.approx(-200.0, abs=1.0)


@pytest.mark.slow
def test_a_single_outlier_fix_is_refused(boat: EstimatedBoat) -> None:
    boat.fix_offset_m = 40.0
    boat.sail(0.2)
    boat.fix_offset_m = 0.0
    assert boat.global_estimate.x_m == pytest.approx(boat.x_m, abs=1.0)
    assert boat.global_estimate.healthy


@pytest.mark.slow
def test_l5_stopped_flag(boat: EstimatedBoat) -> None:
    """L5: set after 2 s below 0.05 m/s, cleared at once when the boat moves."""
    boat.sail(6.0)
    assert boat.global_estimate.stopped
    boat.sail(3.0, surge_mps=0.4)
    assert not boat.global_estimate.stopped


@pytest.mark.parametrize("surge_mps", [0.0, 0.04, 0.07])
@pytest.mark.slow
def test_l5_a_boat_is_stopped_after_two_seconds_below_0_05_mps(boat: EstimatedBoat, surge_mps: float) -> None:
    """L5: by the estimated speed of every step, of a boat that slows down to this speed."""
    boat.sail(3.0, surge_mps=0.4)
    slow_since_us, flags = None, []
    for estimate in boat.sail(15.0, surge_mps=surge_mps):
        if math.hypot(estimate.surge_mps, estimate.sway_mps) > 0.05:
            slow_since_us = None
        elif slow_since_us is None:
            slow_since_us = estimate.source_us
        flags.append(estimate.stopped)
        assert estimate.stopped is (slow_since_us is not None and estimate.source_us - slow_since_us >= 2_000_000)
    assert any(flags) is (surge_mps < 0.05)


@pytest.mark.slow
def test_gyro_bias_is_estimated_at_rest(boat: EstimatedBoat) -> None:
    rates = [one.yaw_rate_radps for one in boat.sail(2.0)]
    assert statistics.fmean(rates) == pytest.approx(0.0, abs=6e-4)


@pytest.mark.parametrize(("roll_rad", "pitch_rad"), [(0.05, 0.0), (0.0, 0.05), (-0.04, 0.06)])
@pytest.mark.slow
def test_tilt_is_not_taken_for_acceleration(boat: EstimatedBoat, roll_rad: float, pitch_rad: float) -> None:
    """A boat at rest that heels or trims measures gravity along its axes, and is estimated at rest."""
    for _ in range(40):
        tilted = msgspec.structs.replace(
            boat.sample(0.0, 0.0),
            roll_rad=roll_rad,
            pitch_rad=pitch_rad,
            accel_x_mps2=-9.81 * math.sin(pitch_rad),
            accel_y_mps2=9.81 * math.sin(roll_rad) * math.cos(pitch_rad),
        )
        local, _ = boat.estimator.step([tilted], None, boat.now_us)
        assert math.hypot(local.surge_mps, local.sway_mps) < 0.05


def test_the_gyro_bias_is_not_taken_from_a_boat_that_turns() -> None:
    boat = EstimatedBoat()
    turning = [boat.sample(0.5, 0.1) for _ in range(200)]
    assert estimate_gyro_bias(turning).radps == 0.0
    assert estimate_gyro_bias(turning).std_radps == UNCALIBRATED_STD_RADPS
    resting = [boat.sample(0.0, 0.0) for _ in range(200)]
    assert estimate_gyro_bias(resting).radps == pytest.approx(BIAS_RADPS, abs=5e-4)


@pytest.mark.slow
def test_a12_without_heading_there_is_no_health() -> None:
    """A12: an IMU that marks its orientation unavailable gives no yaw to steer by."""
    boat = EstimatedBoat()
    boat.change_samples = lambda samples: [
        msgspec.structs.replace(each, orientation_available=False) for each in samples
    ]
    assert not any(one.healthy for one in boat.sail(6.0))
    assert not any(one.healthy for one in boat.sail(60.0, surge_mps=0.6))


@pytest.mark.slow
def test_a12_a_compass_that_falls_silent_ends_health(boat: EstimatedBoat) -> None:
    """A12: the gyro keeps the heading for 3 s, no longer."""
    boat.sail(10.0, surge_mps=0.6)
    boat.change_samples = lambda samples: [
        msgspec.structs.replace(each, orientation_available=False) for each in samples
    ]
    estimates = boat.sail(5.0, surge_mps=0.6)
    assert estimates[50].healthy
    assert not any(one.healthy for one in estimates[62:])


def stuck(sample: ImuSample) -> ImuSample:
    return msgspec.structs.replace(sample, gyro_z_radps=0.0)


def in_degrees(sample: ImuSample) -> ImuSample:
    return msgspec.structs.replace(sample, gyro_z_radps=sample.gyro_z_radps * 180.0 / math.pi)


def in_turns(sample: ImuSample) -> ImuSample:
    return msgspec.structs.replace(sample, gyro_z_radps=sample.gyro_z_radps / (2.0 * math.pi))


def reversed_turns(sample: ImuSample) -> ImuSample:
    return msgspec.structs.replace(sample, gyro_z_radps=-sample.gyro_z_radps)


@pytest.mark.parametrize("fault", [stuck, in_turns, in_degrees, reversed_turns])
@pytest.mark.slow
def test_a_gyro_that_contradicts_the_compass_is_believed_no_more_than_it(
    fault: Callable[[ImuSample], ImuSample],
) -> None:
    """Compass and receiver are right: what is called healthy is no more than 30 degrees off, and seldom so."""
    boat = EstimatedBoat()
    boat.change_samples = lambda samples: [fault(each) for each in samples]
    boat.sail(10.0)
    healthy, steps, wrong = 0, 0, 0
    for leg in range(12):
        for _ in range(25):
            boat.sail(0.2, surge_mps=0.6, yaw_rate_radps=0.2 if leg % 2 else 0.0)
            estimate, steps = boat.global_estimate, steps + 1
            if estimate.healthy:
                off_rad = abs(wrap_rad(estimate.yaw_rad - boat.yaw_rad))
                assert off_rad < math.radians(30.0)
                healthy, wrong = healthy + 1, wrong + (off_rad > 3.0 * estimate.yaw_std_rad)
    assert wrong <= 0.05 * steps
    assert healthy < 0.3 * steps


@pytest.mark.slow
def test_of_samples_after_a_stall_the_gap_before_them_counts_not_their_number(boat: EstimatedBoat) -> None:
    """A process that was held up for five seconds finds the newest samples alone, as many as its queue holds."""
    kept = deque[ImuSample](maxlen=64)
    for number in range(500):
        kept.append(boat.sample(0.0, 0.3 if number < 430 else 0.0))
    boat.estimator.step(list(kept), boat.fix(), boat.now_us)
    assert wrap_rad(boat.yaw_rad) != pytest.approx(0.5, abs=0.5)
    after = [each for each in boat.sail(5.0) if each.healthy]
    assert after
    assert max(abs(wrap_rad(each.yaw_rad - boat.yaw_rad)) for each in after) < 0.1


@pytest.mark.parametrize("late", [0, 2, 4])
@pytest.mark.slow
def test_a_late_fix_says_where_the_boat_was(late: int) -> None:
    """A receiver that hands out its fixes 0.4 or 0.8 s later shifts a boat at 1 m/s by a third of that at most.

    What remains is of the way in which it gathered speed.
    """
    boat, fixes = EstimatedBoat(fix_noise_m=0.05), deque[GpsFix](maxlen=late + 1)

    def delay(fix: GpsFix) -> GpsFix:
        fixes.append(fix)
        return fixes[0]

    boat.change_fix = delay
    boat.sail(25.0, surge_mps=1.0)
    ahead_m = []
    for _ in range(50):
        boat.sail(0.2, surge_mps=1.0)
        estimate = boat.global_estimate
        east_m, north_m = estimate.x_m - boat.x_m, estimate.y_m - boat.y_m
        ahead_m.append(east_m * math.cos(boat.yaw_rad) + north_m * math.sin(boat.yaw_rad))
    assert boat.global_estimate.healthy
    assert statistics.fmean(ahead_m) == pytest.approx(0.0, abs=0.05 + late * 0.2 / 3.0)


@pytest.mark.parametrize("off_s", [-1.1, 1.1])
@pytest.mark.slow
def test_a_fix_from_another_time_than_the_imu_s_is_dropped_and_counted(boat: EstimatedBoat, off_s: float) -> None:
    """Behind it or ahead of it: the position at the time of the IMU would be a guess."""
    boat.imu = off_s < 0.0  # a fix ahead of the IMU is one whose IMU has fallen silent
    boat.gps = False
    boat.sail(1.3)
    before, taken_us = boat.estimator.drops["gps_out_of_step"], boat.now_us + round(min(off_s, 0.0) * 1e6)
    boat.estimator.step([], msgspec.structs.replace(boat.fix(), source_us=taken_us), boat.now_us)
    assert boat.estimator.drops["gps_out_of_step"] == before + 1


@pytest.mark.parametrize("gap_s", [1.0, 3.0])
@pytest.mark.slow
def test_what_the_imu_saw_before_a_gap_does_not_say_that_the_boat_lies_still_after_it(
    boat: EstimatedBoat, gap_s: float
) -> None:
    """It has gathered way meanwhile, which no sample shows."""
    boat.sail(20.0)
    assert boat.global_estimate.stopped
    boat.imu = False
    boat.sail(gap_s, surge_mps=0.5)
    boat.imu = True
    after = [each for each in boat.sail(5.0, surge_mps=0.5) if each.healthy]
    assert len(after) > 50
    assert [(each.stopped, abs(each.surge_mps - 0.5) < 0.2) for each in after] == [(False, True)] * len(after)


@pytest.mark.parametrize("gap_s", [1.0, 2.0])
@pytest.mark.slow
def test_a_gap_of_the_imu_widens_the_estimates_by_the_way_that_the_boat_may_have_made(
    boat: EstimatedBoat, gap_s: float
) -> None:
    """At up to 0.5 m/s."""
    boat.gps = False
    boat.sail(0.05)
    before_m = boat.global_estimate.position_std_m
    boat.imu = False
    boat.sail(gap_s)
    boat.imu = True
    boat.sail(0.05)
    assert boat.global_estimate.position_std_m > 0.95 * math.hypot(before_m, 0.5 * gap_s)


@pytest.mark.slow
def test_first_fix_is_the_origin_when_none_is_set() -> None:
    boat = EstimatedBoat(LocalizationConfig())
    boat.sail(4.0)
    assert math.hypot(boat.global_estimate.x_m, boat.global_estimate.y_m) < 1.5


@pytest.mark.slow
def test_a_boat_that_has_moved_is_not_moored_because_its_imu_began_anew(boat: EstimatedBoat) -> None:
    """Adrift, too slowly for the receiver to tell: only that it never moved says that a boat lies still."""
    boat.sail(4.0, surge_mps=0.6)
    boat.sail(25.0, surge_mps=0.03)
    boat.epoch += 1
    boat.sail(30.0, surge_mps=0.03)
    assert boat.global_estimate.healthy
    assert math.hypot(boat.global_estimate.surge_mps, boat.global_estimate.sway_mps) > 0.0
