"""What of the sensors' messages may be used. Pure; every refusal is counted under its cause."""

import math
from collections import Counter
from collections.abc import Sequence

import msgspec

from paani.messages import GpsFix, ImuSample, Message

MAX_FUTURE_S = 0.1  # as `NavigatorConfig.max_future_s`
MIN_POSITION_STD_M = 0.1  # better than that no receiver of ours is


def usable_samples(
    samples: Sequence[ImuSample], last: ImuSample | None, now_us: int, drops: Counter[str]
) -> list[ImuSample]:
    """The samples that are finite, of the newest epoch, in order, later than `last`, and not from the future."""
    if not samples:
        return []
    epoch, kept = samples[-1].epoch, list[ImuSample]()
    after_us = last.source_us if last is not None and last.epoch == epoch else -1
    for sample in samples:
        if not _is_finite(sample):
            drops["imu_not_finite"] += 1
        elif sample.source_us > now_us + MAX_FUTURE_S * 1e6:
            drops["imu_future"] += 1
        elif sample.epoch != epoch or sample.source_us <= after_us:
            drops["imu_late"] += 1
        else:
            kept.append(sample)
            after_us = sample.source_us
    return kept


def usable_fix(fix: GpsFix, last: GpsFix | None, now_us: int, drops: Counter[str]) -> GpsFix | None:
    """The fix, its spread not below what a receiver can do; None if it must not be used."""
    if not fix.fix:
        return None
    if not _is_finite(fix) or abs(fix.latitude_deg) > 90.0 or abs(fix.longitude_deg) > 180.0:
        drops["gps_not_finite"] += 1
    elif fix.source_us > now_us + MAX_FUTURE_S * 1e6:
        drops["gps_future"] += 1
    elif last is not None and fix.epoch == last.epoch and fix.source_us <= last.source_us:
        drops["gps_late"] += 1
    else:
        return msgspec.structs.replace(fix, position_std_m=max(fix.position_std_m, MIN_POSITION_STD_M))
    return None


def _is_finite(message: Message) -> bool:
    return all(math.isfinite(value) for value in msgspec.structs.astuple(message) if isinstance(value, float))
