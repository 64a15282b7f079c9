"""Checks of the sensors' messages before they reach the filters. Pure; every refusal is counted under its cause."""

from collections import Counter
from collections.abc import Sequence

import msgspec

from paani.messages import GpsFix, ImuSample

MAX_FUTURE_S = 0.1  # a stamp further ahead of now is refused; as `NavigatorConfig.max_future_s`
MIN_POSITION_STD_M = 0.1  # no receiver is better; a smaller claim is raised to this
MAX_POSITION_STD_M = 1000.0  # a worse fix is no position
MAX_SOG_MPS = 100.0  # faster than any boat
MAX_ACCEL_MPS2, MAX_RATE_RADPS = 160.0, 35.0  # the widest ranges of small IMUs: 16 g, 2000 degrees a second
MAX_ANGLE_RAD = 1e4  # far more than a full circle, because some sensors count their turns


def take_samples(
    samples: Sequence[ImuSample], last: ImuSample | None, now_us: int, drops: Counter[str]
) -> tuple[list[ImuSample], bool]:
    """The usable samples, and whether estimates begin anew: the IMU has a new epoch, or the clock was set back."""
    is_set_back = last is not None and last.source_us > now_us + MAX_FUTURE_S * 1e6
    usable = _select_usable(samples, None if is_set_back else last, now_us, drops)
    is_restarted = last is not None and bool(usable) and usable[-1].epoch != last.epoch
    return usable, is_set_back or is_restarted


def _select_usable(
    samples: Sequence[ImuSample], last: ImuSample | None, now_us: int, drops: Counter[str]
) -> list[ImuSample]:
    """The samples within an IMU's ranges, of the newest epoch, in order, later than `last` and not ahead of now."""
    if not samples:
        return []
    epoch, usable = samples[-1].epoch, list[ImuSample]()
    after_us = last.source_us if last is not None and last.epoch == epoch else -1
    for sample in samples:
        if not _is_possible_sample(sample):
            drops["imu_impossible"] += 1
        elif sample.source_us > now_us + MAX_FUTURE_S * 1e6:
            drops["imu_future"] += 1
        elif sample.epoch != epoch or sample.source_us <= after_us:
            drops["imu_late"] += 1
        else:
            usable.append(sample)
            after_us = sample.source_us
    return usable


def check_fix(fix: GpsFix, last: GpsFix | None, now_us: int, drops: Counter[str]) -> GpsFix | None:
    """The fix, its standard deviation raised to what a receiver can do; None if it must not be used."""
    if not fix.fix:
        return None
    if not _is_possible_fix(fix):
        drops["gps_impossible"] += 1
    elif fix.source_us > now_us + MAX_FUTURE_S * 1e6:
        drops["gps_future"] += 1
    elif last is not None and fix.epoch == last.epoch and fix.source_us <= last.source_us:
        drops["gps_late"] += 1
    else:
        return msgspec.structs.replace(fix, position_std_m=max(fix.position_std_m, MIN_POSITION_STD_M))
    return None


def _is_possible_sample(sample: ImuSample) -> bool:
    """Whether every number is within an IMU's ranges; comparisons with NaN are false."""
    return (
        abs(sample.accel_x_mps2) <= MAX_ACCEL_MPS2
        and abs(sample.accel_y_mps2) <= MAX_ACCEL_MPS2
        and abs(sample.accel_z_mps2) <= MAX_ACCEL_MPS2
        and abs(sample.gyro_x_radps) <= MAX_RATE_RADPS
        and abs(sample.gyro_y_radps) <= MAX_RATE_RADPS
        and abs(sample.gyro_z_radps) <= MAX_RATE_RADPS
        and abs(sample.roll_rad) <= MAX_ANGLE_RAD
        and abs(sample.pitch_rad) <= MAX_ANGLE_RAD
        and abs(sample.yaw_rad) <= MAX_ANGLE_RAD
    )


def _is_possible_fix(fix: GpsFix) -> bool:
    """Whether every number is one that a receiver can give."""
    return (
        abs(fix.latitude_deg) <= 90.0
        and abs(fix.longitude_deg) <= 180.0
        and 0.0 <= fix.sog_mps <= MAX_SOG_MPS
        and abs(fix.cog_rad) <= MAX_ANGLE_RAD
        and 0.0 <= fix.position_std_m <= MAX_POSITION_STD_M
    )
