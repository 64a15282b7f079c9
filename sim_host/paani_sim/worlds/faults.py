"""Faults of a scenario and their times. Values only."""

from collections.abc import Iterable
from enum import StrEnum
from typing import NamedTuple


class FaultKind(StrEnum):
    """What breaks. The unit of `Fault.amount` stands behind each."""

    CAMERA_BLACK = "camera_black"
    CAMERA_FROZEN = "camera_frozen"
    CAMERA_BLURRED = "camera_blurred"  # standard deviation of the blur [px at 320 px width]
    CAMERA_DROPPED = "camera_dropped"  # no pictures come
    GPS_OUTAGE = "gps_outage"
    GPS_JUMP = "gps_jump"  # offset to the east [m]
    COMPASS_BIAS = "compass_bias"  # [rad]
    GYRO_BIAS = "gyro_bias"  # on the yaw rate [rad/s]
    SONAR_FROZEN = "sonar_frozen"  # it repeats the last depth before, or one amount [m] where that is above 0
    LINK_LOSS = "link_loss"  # nothing crosses between board and host
    THRUSTER_LOSS = "thruster_loss"  # force lost by the left fan, 0..1; negative: by the right fan


class Fault(NamedTuple):
    """One fault from `start_s` on for `duration_s` [simulated s]."""

    kind: FaultKind
    start_s: float
    duration_s: float = float("inf")
    amount: float = 0.0

    def is_active(self, t_s: float) -> bool:
        """Whether it acts at `t_s`."""
        return self.start_s <= t_s < self.start_s + self.duration_s


def find_active_fault(faults: Iterable[Fault], kind: FaultKind, t_s: float) -> Fault | None:
    """The first fault of this kind that acts at `t_s`."""
    return next((fault for fault in faults if fault.kind is kind and fault.is_active(t_s)), None)


def is_linked(faults: Iterable[Fault], t_s: float) -> bool:
    """Whether messages pass between board and host at `t_s`."""
    return find_active_fault(faults, FaultKind.LINK_LOSS, t_s) is None
