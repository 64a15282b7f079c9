"""Faults of GPS, compass, gyro and messages: an estimate that is not known is unhealthy, and refusals are counted."""

import copy
import functools
import math
from itertools import pairwise

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paani.config import LocalizationConfig
from paani.messages import GpsFix, ImuSample, Odometry
from tests.unit.paani_services.localization.estimated_boat import START_US, EstimatedBoat, shifted, wandering


@functools.cache
def under_way() -> EstimatedBoat:
    boat = wandering()
    boat.sail(20.0)
    boat.sail(20.0, surge_mps=0.6)
    assert boat.global_estimate.healthy
    return boat


def ready() -> EstimatedBoat:
    """A boat under way whose estimate is calibrated, converged and healthy."""
    return copy.deepcopy(under_way())


def heading_error_rad(boat: EstimatedBoat) -> float:
    return abs(math.remainder(boat.global_estimate.yaw_rad - boat.yaw_rad, 2.0 * math.pi))


def test_without_gps_the_standard_deviation_grows_until_the_estimate_is_unhealthy() -> None:
    boat = ready()
    boat.gps = False
    estimates = boat.sail(30.0, surge_mps=0.6)
    assert estimates[40].healthy
    assert not any(each.healthy for each in estimates[62:])
    assert estimates[-1].position_std_m > 3.0 > estimates[0].position_std_m
    assert boat.error_m() < 3.0 * estimates[-1].position_std_m


def test_gps_that_comes_back_moves_the_estimate_before_it_is_healthy() -> None:
    boat = ready()
    boat.gps = False
    boat.sail(30.0, surge_mps=0.6)
    boat.gps = True
    estimates = boat.sail(5.0, surge_mps=0.6)
    assert not any(each.healthy for each in estimates[:8])
    assert estimates[-1].healthy
    back = [each for each in estimates if each.healthy]
    assert max(math.dist((a.x_m, a.y_m), (b.x_m, b.y_m)) for a, b in pairwise(back)) < 0.3


@pytest.mark.parametrize("offset_m", [4.0, 8.0, 80.0])
def test_a_receiver_that_jumps_is_refused_then_followed_and_never_silently(offset_m: float) -> None:
    boat = ready()
    before = boat.global_estimate
    boat.fix_offset_m = offset_m
    estimates = [before, *boat.sail(10.0, surge_mps=0.6)]
    for earlier, later in pairwise(estimates):
        if math.dist((earlier.x_m, earlier.y_m), (later.x_m, later.y_m)) > 1.0:
            assert not earlier.healthy
            assert not later.healthy
    assert estimates[-1].refused_fixes >= 10
    assert estimates[-1].x_m - boat.x_m == pytest.approx(offset_m, abs=3.0)
    assert estimates[-1].position_std_m > 0.5 * offset_m


def test_after_a_jump_the_estimate_is_unhealthy_until_the_doubt_has_faded() -> None:
    """Which of the two positions was wrong cannot be known: 80 m of doubt exceed the limit for more than a minute."""
    boat = ready()
    boat.fix_offset_m = 80.0
    boat.sail(60.0)
    assert not boat.global_estimate.healthy
    boat.sail(90.0)
    assert boat.global_estimate.healthy


def test_fixes_that_contradict_each_other_are_never_followed() -> None:
    boat = ready()
    for number in range(40):
        boat.fix_offset_m = 30.0 * (-1) ** number
        boat.sail(0.2, surge_mps=0.6)
    assert not boat.global_estimate.healthy
    assert boat.error_m() < 2.5


def test_a_few_outlier_fixes_change_nothing() -> None:
    boat = ready()
    boat.fix_offset_m = 40.0
    boat.sail(0.4, surge_mps=0.6)
    boat.fix_offset_m = 0.0
    assert boat.global_estimate.healthy
    assert boat.error_m() < 2.5


def test_compass_bias_is_found_under_way() -> None:
    """More than half of 0.1 rad is corrected after several headings; the published spread covers the rest."""
    boat = ready()
    boat.compass_bias_rad = 0.1
    errors = []
    for _ in range(16):
        boat.sail(10.0, surge_mps=0.6)
        boat.sail(5.0, surge_mps=0.6, yaw_rate_radps=0.2)
        errors.append(heading_error_rad(boat))
        assert boat.global_estimate.healthy
        assert errors[-1] < 2.5 * boat.global_estimate.yaw_std_rad
    assert max(errors[-4:]) < 0.05


def test_compass_bias_does_not_wander_at_rest() -> None:
    boat = wandering()
    boat.sail(10.0)
    at_first = boat.global_estimate.yaw_rad
    boat.sail(120.0)
    assert boat.global_estimate.yaw_rad == pytest.approx(at_first, abs=0.02)
    assert boat.global_estimate.yaw_std_rad > 0.04


@pytest.mark.parametrize("fault_radps", [0.02, -0.1])
def test_a_new_gyro_bias_does_not_turn_the_estimate(fault_radps: float) -> None:
    boat = ready()
    boat.gyro_fault_radps = fault_radps
    estimates = boat.sail(40.0, surge_mps=0.6)
    assert heading_error_rad(boat) < 0.1 or not estimates[-1].healthy


def test_after_a_gap_of_the_imu_the_estimate_is_unhealthy_until_fixes_agree() -> None:
    """During the gap the boat may have moved anywhere near."""
    boat = ready()
    boat.imu = False
    boat.sail(4.0, surge_mps=0.6)
    assert not boat.global_estimate.healthy
    boat.imu = True
    estimates = boat.sail(10.0, surge_mps=0.6)
    assert not estimates[0].healthy
    assert estimates[-1].healthy
    assert boat.error_m() < 2.5


def test_repeated_and_late_samples_are_counted_and_change_nothing() -> None:
    clean, disturbed = wandering(), wandering()
    disturbed.change_samples = lambda samples: [*samples, samples[0], shifted(samples[2], -300_000)]
    assert clean.sail(30.0, surge_mps=0.5) == disturbed.sail(30.0, surge_mps=0.5)
    assert disturbed.estimator.drops == {"imu_late": 2 * 600}


def test_a_late_or_repeated_fix_is_counted_and_changes_nothing() -> None:
    clean, disturbed = wandering(), wandering()
    clean.sail(10.0)
    disturbed.sail(10.0)
    fix = disturbed.fix()
    clean.fix()
    clean.gps = disturbed.gps = False
    disturbed.estimator.step([], msgspec.structs.replace(fix, source_us=fix.source_us - 500_000), disturbed.now_us)
    clean.estimator.step([], None, clean.now_us)
    assert clean.sail(1.0) == disturbed.sail(1.0)
    assert disturbed.estimator.drops == {"gps_late": 1}


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1e8])
def test_impossible_numbers_are_counted_and_change_nothing(value: float) -> None:
    clean, disturbed = wandering(), wandering()
    names = [name for name in ImuSample.__struct_fields__ if name.endswith(("_radps", "_mps2", "_rad"))]
    disturbed.change_samples = lambda samples: [
        *samples,
        *(msgspec.structs.replace(shifted(samples[-1], 1), **{name: value}) for name in names),
    ]
    assert clean.sail(10.0) == disturbed.sail(10.0)
    assert disturbed.estimator.drops == {"imu_impossible": 200 * len(names)}


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("latitude_deg", math.nan), ("longitude_deg", 181.0), ("sog_mps", math.inf), ("sog_mps", 300.0),
        ("cog_rad", math.nan), ("position_std_m", math.inf), ("position_std_m", -1.0),
    ],
)  # fmt: skip
def test_an_impossible_fix_is_counted_and_not_used(field: str, value: float) -> None:
    boat = ready()
    boat.change_fix = lambda fix: msgspec.structs.replace(fix, **{field: value})
    assert not boat.sail(5.0, surge_mps=0.6)[-1].healthy
    assert boat.estimator.drops == {"gps_impossible": 25}


def test_a_fix_far_from_the_origin_is_refused() -> None:
    boat = wandering()
    boat.change_fix = lambda fix: msgspec.structs.replace(fix, latitude_deg=51.0)
    assert not any(each.healthy for each in boat.sail(10.0))
    assert boat.estimator.drops["gps_far"] > 40


def test_stamps_from_the_future_do_not_keep_the_estimate_healthy() -> None:
    boat = ready()
    boat.change_samples = lambda samples: [shifted(each, 3_600_000_000) for each in samples]
    assert not boat.sail(1.0)[-1].healthy
    assert not boat.local_estimate.healthy
    boat.change_samples = lambda samples: samples
    assert boat.sail(5.0)[-1].healthy


def test_a_clock_set_back_starts_anew() -> None:
    boat = ready()
    boat.now_us -= 20_000_000
    estimates = boat.sail(1.0)
    assert not any(each.healthy for each in estimates)
    assert boat.sail(5.0)[-1].healthy


def test_the_origin_outlives_a_new_epoch_of_the_imu() -> None:
    """The map of the route does not move when the IMU restarts."""
    boat = wandering(config=LocalizationConfig())
    boat.sail(10.0)
    x_m = boat.global_estimate.x_m
    boat.epoch, boat.x_m = 1, boat.x_m + 30.0
    boat.sail(10.0)
    assert boat.global_estimate.x_m - x_m == pytest.approx(30.0, abs=2.0)


def test_nis_is_two_on_average_for_a_wandering_receiver() -> None:
    """For a receiver whose error wanders, the mean NIS over minutes is within the 95 % band about 2."""
    boat, found = wandering(), []
    boat.sail(40.0)
    for _ in range(6):
        found += boat.sail(15.0, surge_mps=0.6)[::4]
        found += boat.sail(10.0, surge_mps=0.6, yaw_rate_radps=0.15)[::4]
    nis = [each.nis for each in found]
    assert sum(nis) / len(nis) == pytest.approx(2.0, abs=1.96 * math.sqrt(4.0 / len(nis)))
    assert found[-1].refused_fixes == 0


finite = st.floats(-1e9, 1e9)
samples = st.builds(
    ImuSample,
    source_us=st.integers(START_US, START_US + 60_000_000),
    epoch=st.integers(0, 1),
    gyro_x_radps=finite,
    gyro_y_radps=finite,
    gyro_z_radps=st.floats(-40.0, 40.0),
    accel_x_mps2=st.floats(-200.0, 200.0),
    accel_y_mps2=st.floats(-200.0, 200.0),
    accel_z_mps2=finite,
    orientation_available=st.booleans(),
    yaw_rad=finite,
)
fixes = st.builds(
    GpsFix,
    source_us=st.integers(START_US, START_US + 60_000_000),
    latitude_deg=st.floats(49.9, 50.1),
    longitude_deg=st.floats(-180.0, 180.0),
    sog_mps=st.floats(0.0, 1e9),
    cog_rad=finite,
    position_std_m=st.floats(0.0, 1e9),
)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(st.lists(samples, max_size=3), st.none() | fixes), max_size=8))
def test_any_input_gives_an_estimate_that_encodes_and_decodes(
    inputs: list[tuple[list[ImuSample], GpsFix | None]],
) -> None:
    """M11: no message stops the estimator, and every estimate can be sent."""
    boat = ready()
    for some, fix in inputs:
        boat.now_us += 50_000
        for estimate in boat.estimator.step(some, fix, boat.now_us):
            assert msgspec.json.decode(msgspec.json.encode(estimate), type=Odometry) == estimate
