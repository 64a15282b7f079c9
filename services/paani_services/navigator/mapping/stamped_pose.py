"""Poses of the boat by dead reckoning, each with its time. Pure."""

import itertools

import msgspec

from paani.geometry import wrap_rad


class StampedPose(msgspec.Struct, frozen=True, rename={"stamp_us": "at_us"}):
    """Dead-reckoned position and attitude of the boat at one time. It is recorded under the field names of `rename`."""

    stamp_us: int
    x_m: float
    y_m: float
    yaw_rad: float
    roll_rad: float
    pitch_rad: float


def interpolate_pose(poses: tuple[StampedPose, ...], stamp_us: int, max_gap_s: float) -> StampedPose | None:
    """The pose at a time, between the two around it, or the nearest; None if that is more than `max_gap_s` off."""
    if not poses:
        return None
    nearest = min(poses, key=lambda pose: abs(pose.stamp_us - stamp_us))
    if abs(nearest.stamp_us - stamp_us) * 1e-6 > max_gap_s:
        return None
    for before, after in itertools.pairwise(poses):
        if before.stamp_us <= stamp_us <= after.stamp_us and after.stamp_us > before.stamp_us:
            part = (stamp_us - before.stamp_us) / (after.stamp_us - before.stamp_us)
            return StampedPose(
                stamp_us,
                before.x_m + part * (after.x_m - before.x_m),
                before.y_m + part * (after.y_m - before.y_m),
                before.yaw_rad + part * wrap_rad(after.yaw_rad - before.yaw_rad),
                before.roll_rad + part * (after.roll_rad - before.roll_rad),
                before.pitch_rad + part * (after.pitch_rad - before.pitch_rad),
            )
    return nearest
