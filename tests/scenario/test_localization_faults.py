"""What the estimate says when GPS, compass, gyro and messages fail: unknown is unhealthy, and nothing is silent."""

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
from tests.unit.paani_services.localization.boat_ride import START_US, Ride, shifted, wandering


@functools.cache
def under_way() -> Ride:
    boat = wandering()
    boat.go(20.0)
    boat.go(20.0, surge_mps=0.6)
    assert boat.glob.healthy
    return boat


def ready() -> Ride:
    """Calibrated, converged, under way."""
    return copy.deepcopy(under_way())


def heading_error_rad(boat: Ride) -> float:
    return abs(math.remainder(boat.glob.yaw_rad - boat.yaw_rad, 2.0 * math.pi))


def test_without_gps_the_spread_grows_until_health_ends() -> None:
    boat = ready()
    boat.gps = False
    said = boat.go(30.0, surge_mps=0.6)
    assert said[40].healthy
    assert not any(each.healthy for each in said[62:])
    assert said[-1].position_std_m > 3.0 > said[0].position_std_m
    assert boat.off_m() < 3.0 * said[-1].position_std_m


def test_gps_that_comes_back_moves_the_estimate_before_it_is_healthy() -> None:
    boat = ready()
    boat.gps = False
    boat.go(30.0, surge_mps=0.6)
    boat.gps = True
    said = boat.go(5.0, surge_mps=0.6)
    assert not any(each.healthy for each in said[:8])
    assert said[-1].healthy
    back = [each for each in said if each.healthy]
    assert max(math.dist((a.x_m, a.y_m), (b.x_m, b.y_m)) for a, b in pairwise(back)) < 0.3


@pytest.mark.parametrize("offset_m", [4.0, 8.0, 80.0])
def test_a_receiver_that_jumps_is_refused_then_followed_and_never_silently(offset_m: float) -> None:
    boat = ready()
    before = boat.glob
    boat.fix_offset_m = offset_m
    said = [before, *boat.go(10.0, surge_mps=0.6)]
    for earlier, later in pairwise(said):
        if math.dist((earlier.x_m, earlier.y_m), (later.x_m, later.y_m)) > 1.0:
            assert not earlier.healthy
            assert not later.healthy
    assert said[-1].refused_fixes >= 10
    assert said[-1].x_m - boat.x_m == pytest.approx(offset_m, abs=3.0)
    assert said[-1].position_std_m > 0.5 * offset_m


def test_after_a_jump_health_waits_until_the_doubt_has_faded() -> None:
    """Which of the two places was wrong nobody knows: 80 m of doubt outlast the limit for more than a minute."""
    boat = ready()
    boat.fix_offset_m = 80.0
    boat.go(60.0)
    assert not boat.glob.healthy
    boat.go(90.0)
    assert boat.glob.healthy


def test_fixes_that_contradict_each_other_are_never_followed() -> None:
    boat = ready()
    for number in range(40):
        boat.fix_offset_m = 30.0 * (-1) ** number
        boat.go(0.2, surge_mps=0.6)
    assert not boat.glob.healthy
    assert boat.off_m() < 2.5


def test_a_few_wild_fixes_change_nothing() -> None:
    boat = ready()
    boat.fix_offset_m = 40.0
    boat.go(0.4, surge_mps=0.6)
    boat.fix_offset_m = 0.0
    assert boat.glob.healthy
    assert boat.off_m() < 2.5


def test_compass_bias_is_found_under_way() -> None:
    """More than half of 0.1 rad is undone once the boat has steered several headings; the spread covers it."""
    boat = ready()
    boat.compass_bias_rad = 0.1
    errors = []
    for _ in range(16):
        boat.go(10.0, surge_mps=0.6)
        boat.go(5.0, surge_mps=0.6, yaw_rate_radps=0.2)
        errors.append(heading_error_rad(boat))
        assert boat.glob.healthy
        assert errors[-1] < 2.5 * boat.glob.yaw_std_rad
    assert max(errors[-4:]) < 0.05


def test_compass_bias_does_not_wander_at_rest() -> None:
    boat = wandering()
    boat.go(10.0)
    at_first = boat.glob.yaw_rad
    boat.go(120.0)
    assert boat.glob.yaw_rad == pytest.approx(at_first, abs=0.02)
    assert boat.glob.yaw_std_rad > 0.04


@pytest.mark.parametrize("fault_radps", [0.02, -0.1])
def test_a_gyro_that_begins_to_err_does_not_turn_the_estimate(fault_radps: float) -> None:
    boat = ready()
    boat.gyro_fault_radps = fault_radps
    said = boat.go(40.0, surge_mps=0.6)
    assert heading_error_rad(boat) < 0.1 or not said[-1].healthy


def test_a_gap_of_the_imu_is_admitted() -> None:
    """After it, the boat may be anywhere near: not healthy before fixes have said where."""
    boat = ready()
    boat.imu = False
    boat.go(4.0, surge_mps=0.6)
    assert not boat.glob.healthy
    boat.imu = True
    said = boat.go(10.0, surge_mps=0.6)
    assert not said[0].healthy
    assert said[-1].healthy
    assert boat.off_m() < 2.5


def test_repeated_and_late_samples_are_counted_and_change_nothing() -> None:
    clean, disturbed = wandering(), wandering()
    disturbed.change = lambda samples: [*samples, samples[0], shifted(samples[2], -300_000)]
    assert clean.go(30.0, surge_mps=0.5) == disturbed.go(30.0, surge_mps=0.5)
    assert disturbed.estimator.drops == {"imu_late": 2 * 600}


def test_a_late_or_repeated_fix_is_counted_and_changes_nothing() -> None:
    clean, disturbed = wandering(), wandering()
    clean.go(10.0)
    disturbed.go(10.0)
    fix = disturbed.fix()
    clean.fix()
    clean.gps = disturbed.gps = False
    disturbed.estimator.step([], msgspec.structs.replace(fix, source_us=fix.source_us - 500_000), disturbed.now_us)
    clean.estimator.step([], None, clean.now_us)
    assert clean.go(1.0) == disturbed.go(1.0)
    assert disturbed.estimator.drops == {"gps_late": 1}


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1e8])
def test_impossible_numbers_are_counted_and_change_nothing(value: float) -> None:
    clean, disturbed = wandering(), wandering()
    names = [name for name in ImuSample.__struct_fields__ if name.endswith(("_radps", "_mps2", "_rad"))]
    disturbed.change = lambda samples: [
        *samples,
        *(msgspec.structs.replace(shifted(samples[-1], 1), **{name: value}) for name in names),
    ]
    assert clean.go(10.0) == disturbed.go(10.0)
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
    assert not boat.go(5.0, surge_mps=0.6)[-1].healthy
    assert boat.estimator.drops == {"gps_impossible": 25}


def test_a_fix_far_from_the_origin_is_no_place_on_the_map() -> None:
    boat = wandering()
    boat.change_fix = lambda fix: msgspec.structs.replace(fix, latitude_deg=51.0)
    assert not any(each.healthy for each in boat.go(10.0))
    assert boat.estimator.drops["gps_far"] > 40


def test_stamps_from_the_future_keep_nothing_fresh() -> None:
    boat = ready()
    boat.change = lambda samples: [shifted(each, 3_600_000_000) for each in samples]
    assert not boat.go(1.0)[-1].healthy
    assert not boat.local.healthy
    boat.change = lambda samples: samples
    assert boat.go(5.0)[-1].healthy


def test_a_clock_set_back_starts_anew() -> None:
    boat = ready()
    boat.now_us -= 20_000_000
    said = boat.go(1.0)
    assert not any(each.healthy for each in said)
    assert boat.go(5.0)[-1].healthy


def test_the_origin_outlives_a_new_epoch_of_the_imu() -> None:
    """The map of the route must not move when the IMU begins again."""
    boat = wandering(config=LocalizationConfig())
    boat.go(10.0)
    x_m = boat.glob.x_m
    boat.epoch, boat.x_m = 1, boat.x_m + 30.0
    boat.go(10.0)
    assert boat.glob.x_m - x_m == pytest.approx(30.0, abs=2.0)


def test_nis_says_that_the_stated_spread_is_right() -> None:
    """A wandering receiver is no white one: over minutes the mean NIS is within the 95 % band about 2."""
    boat, found = wandering(), []
    boat.go(40.0)
    for _ in range(6):
        found += boat.go(15.0, surge_mps=0.6)[::4]
        found += boat.go(10.0, surge_mps=0.6, yaw_rate_radps=0.15)[::4]
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
def test_whatever_comes_the_estimate_can_be_said(heard: list[tuple[list[ImuSample], GpsFix | None]]) -> None:
    """M11: no message stops the estimator, and every answer is one that a receiver decodes."""
    boat = ready()
    for some, fix in heard:
        boat.now_us += 50_000
        for said in boat.estimator.step(some, fix, boat.now_us):
            assert msgspec.json.decode(msgspec.json.encode(said), type=Odometry) == said
