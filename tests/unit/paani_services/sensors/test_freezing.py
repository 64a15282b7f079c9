"""A frozen sensor is told from one that rests."""

from __future__ import annotations

import math
import random

import msgspec
import pytest

from paani.messages import GpsFix
from paani_services.sensors.freezing import GravityWatch, HeadingWatch, PositionWatch, SampleWatch
from paani_services.sensors.inertial import InertialSample

REST = GpsFix(source_us=0, latitude_deg=48.0, longitude_deg=11.0, sog_mps=0.0, cog_rad=0.0, position_std_m=2.0)


def fix_at(second: float, **changes: float) -> GpsFix:
    return msgspec.structs.replace(REST, source_us=round(second * 1e6), **changes)


def test_a_receiver_that_holds_its_position_at_rest_is_not_frozen() -> None:
    watch = PositionWatch()
    assert not any(watch.take(fix_at(second, sog_mps=0.3)) for second in range(3000))


def test_a_position_that_stands_while_the_speed_says_four_metres_is_frozen_until_it_moves() -> None:
    watch = PositionWatch()
    frozen = [watch.take(fix_at(0.25 * step, sog_mps=1.0)) for step in range(30)]
    assert frozen.index(True) == 17
    assert all(frozen[17:])
    assert not watch.take(fix_at(7.5, sog_mps=1.0, latitude_deg=48.00001))


def test_a_coarse_position_of_a_sailing_boat_is_not_frozen() -> None:
    """Three decimals of a minute, 1.85 m, at 0.6 m/s: the position stays for three fixes at a time."""
    watch = PositionWatch()
    assert not any(
        watch.take(fix_at(second, sog_mps=0.6, latitude_deg=round(0.6 * second / 1.85) / 60e3)) for second in range(200)
    )


def sample(z: float, ms: int | None = None) -> InertialSample:
    return InertialSample((0.01, 0.02, z), (0.0, 0.001, -0.002), None, ms)


def test_samples_with_noise_are_at_rest_and_the_same_sample_for_half_a_second_is_frozen() -> None:
    watch, noise = SampleWatch(), random.Random(1)
    assert not any(watch.take(sample(round(9.81 + noise.gauss(0.0, 0.02), 2)), 10_000 * step) for step in range(1000))
    frozen = [watch.take(sample(9.0), 10_000_000 + 10_000 * step) for step in range(100)]
    assert frozen.index(True) == 50
    assert all(frozen[50:])
    assert not watch.take(sample(9.01), 11_000_000)


def test_a_slow_unit_is_frozen_after_five_equal_samples() -> None:
    watch = SampleWatch()
    assert [watch.take(sample(9.0), 200_000 * step) for step in range(7)].index(True) == 5


def test_a_unit_whose_clock_stands_is_frozen_whatever_its_samples_say() -> None:
    watch = SampleWatch()
    assert not watch.take(sample(9.0, 100), 10_000)
    assert watch.take(sample(9.1, 100), 20_000)
    assert not watch.take(sample(9.2, 110), 30_000)


def turn(watch: HeadingWatch, rate_radps: float, seconds: float, since_s: float) -> bool:
    return [
        watch.take_sample(rate_radps, round((since_s + 0.01 * step) * 1e6)) for step in range(round(seconds * 100))
    ][-1]


def test_a_heading_that_repeats_at_rest_is_not_frozen_even_beside_a_biased_gyro() -> None:
    watch = HeadingWatch()
    watch.take_heading(1.0)
    assert not turn(watch, 0.08, 120.0, 1.0)


def test_a_heading_that_stands_while_the_gyro_turns_is_frozen_until_it_changes() -> None:
    watch = HeadingWatch()
    watch.take_heading(1.0)
    assert not turn(watch, 0.3, 0.8, 1.0)
    watch.take_heading(1.0)
    assert turn(watch, 0.3, 0.2, 1.8)
    watch.take_heading(1.1)
    assert not turn(watch, 0.3, 0.2, 2.0)


def test_waves_that_turn_the_boat_to_and_fro_are_no_turn() -> None:
    watch = HeadingWatch()
    watch.take_heading(1.0)
    for wave in range(100):
        assert not turn(watch, 0.3 * (-1.0) ** wave, 0.4, 1.0 + 0.4 * wave)


@pytest.mark.parametrize(("z", "is_implausible"), [(9.81, False), (-9.81, True)])
def test_a_unit_that_stands_on_its_head_is_found_at_once(z: float, *, is_implausible: bool) -> None:
    """Its gyro would turn the wrong way."""
    assert GravityWatch().take(sample(z)) is is_implausible


def test_a_unit_that_lies_on_its_side_is_found_and_a_boat_that_heels_is_not() -> None:
    for heel_deg, is_implausible in ((50.0, False), (70.0, True), (90.0, True)):
        heel_rad = math.radians(heel_deg)
        accel_mps2 = (0.0, 9.81 * math.sin(heel_rad), 9.81 * math.cos(heel_rad))
        leaning = InertialSample(accel_mps2, (0.0, 0.0, 0.0), None, None)
        assert GravityWatch().take(leaning) is is_implausible


def test_a_unit_that_writes_g_is_found_at_once_and_a_bump_is_not() -> None:
    assert GravityWatch().take(sample(1.0))
    watch = GravityWatch()
    assert not any(watch.take(sample(9.81)) for _ in range(100))
    assert not any(watch.take(sample(40.0)) for _ in range(3))
    assert not any(watch.take(sample(9.81)) for _ in range(100))
    assert [watch.take(sample(1.0)) for _ in range(100)][-1]
