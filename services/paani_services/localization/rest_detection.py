"""Rest detection: whether the boat lies still, although its GPS shows motion. Pure.

A receiver at a quay shows speeds of decimetres a second for minutes at a time, and a position that wanders by metres.
A boat does not start to move without its IMU measuring it. So rest, once found, is kept against the receiver until
  1. the IMU shows a push, a turn, or more than ripples, or
  2. position and speed of the fixes together leave what the receiver's own error explains.
Finding rest after motion takes more: a quiet IMU, and a mean speed near zero by any receiver's standard. What has moved
is afloat, and water carries it without its IMU measuring it: at rest it makes no way through the water, and no more is
known. Only a boat that never moved is taken to be moored.
The limits were set on one recorded log of ten minutes at a dock.
"""

import math
from collections import deque
from collections.abc import Collection
from statistics import fmean
from typing import NamedTuple

QUIET_S = 2.0  # window of IMU steps; L5 as `stopped_after_s`
MAX_ACCEL_RANGE_MPS2 = 0.5  # between steps of a quiet window: ripples rock a boat at rest; noise alone gives 0.06
MAX_PUSH_MPS = 0.1  # speed gained in `QUIET_S` by the acceleration above that at rest
MAX_TILT_MPS2 = 0.15  # constant acceleration before rest is found: gravity on an IMU mounted 0.9 degrees askew
MAX_TURN_RADPS = 0.02  # mean yaw rate of a quiet window
REST_FOUND_S = 5.0  # window of fixes whose mean speed must be about zero
REST_FOUND_MPS = 0.1  # bound of that mean speed: slower than any speed that the navigator orders
REST_FOUND_SIGMAS, REST_LOST_SIGMAS = 2.5, 4.0  # of the mean speed of the fixes, in its standard deviations
AWAY_SIGMAS, FAR_AWAY_SIGMAS = 2.0, 4.0  # distance of a fix from rest that ends it: with such a speed, and with any
SETTLE_S = 60.0  # time constant with which the position of rest follows the receiver; a drift over 0.05 m/s outruns it


class MotionEvidence(NamedTuple):
    """Level acceleration [m/s^2] and yaw rate [rad/s] of one step of the IMU, biases subtracted."""

    at_us: int
    ahead_mps2: float
    left_mps2: float
    yaw_rate_radps: float


class MapFix(NamedTuple):
    """Position and velocity of one GPS fix in the map frame, with the standard deviations of both."""

    at_us: int
    x_m: float
    y_m: float
    vx_mps: float
    vy_mps: float
    std_m: float
    std_mps: float


class RestDetector:
    """Takes every step of the IMU and every fix; `at_rest` and `is_moored` are the verdicts.

    has_moved: what is known of the boat from before.
    """

    def __init__(self, *, has_moved: bool = False) -> None:
        self._motion: deque[MotionEvidence] = deque()
        self._fixes: deque[MapFix] = deque()
        self._rest_accel_mps2 = (0.0, 0.0)  # mean acceleration when rest was found, ahead and left
        self._rest_position_m = (0.0, 0.0)
        self.has_moved = has_moved
        self.at_rest = False

    @property
    def is_moored(self) -> bool:
        """Whether the boat lies still over ground: at rest, and its IMU never measured motion."""
        return self.at_rest and not self.has_moved

    def add_motion(self, motion: MotionEvidence) -> None:
        """Take one step of the IMU."""
        self._motion.append(motion)
        while motion.at_us - self._motion[0].at_us > QUIET_S * 1e6:
            self._motion.popleft()
        if self.at_rest and self._is_disturbed():
            self._end_rest(by_imu=True)

    def add_fix(self, fix: MapFix) -> None:
        """Take one GPS fix."""
        self._fixes.append(fix)
        while fix.at_us - self._fixes[0].at_us > REST_FOUND_S * 1e6:
            self._fixes.popleft()
        recent = [each for each in self._fixes if fix.at_us - each.at_us <= QUIET_S * 1e6]
        if self.at_rest:
            self._keep_rest(fix, recent)
        elif self._motion:
            self._find_rest(recent)

    def _keep_rest(self, fix: MapFix, recent: list[MapFix]) -> None:
        """End rest if the fixes have left it; else let the position of rest follow the receiver slowly."""
        x_m, y_m = self._rest_position_m
        distance_sigmas = math.hypot(fix.x_m - x_m, fix.y_m - y_m) / fix.std_m
        if distance_sigmas > FAR_AWAY_SIGMAS or (
            distance_sigmas > AWAY_SIGMAS and _mean_speed_sigmas(recent) > REST_LOST_SIGMAS
        ):
            self._end_rest(by_imu=False)
            return
        since_s = (fix.at_us - self._fixes[-2].at_us) * 1e-6 if len(self._fixes) > 1 else 0.0
        gain = 1.0 - math.exp(-since_s / SETTLE_S)
        self._rest_position_m = (x_m + gain * (fix.x_m - x_m), y_m + gain * (fix.y_m - y_m))

    def _find_rest(self, recent: list[MapFix]) -> None:
        """Begin rest if IMU and fixes allow it; a boat whose IMU never measured motion needs less from the fixes."""
        fixes = self._fixes
        if self._motion[-1].at_us - self._motion[0].at_us < 0.9 * QUIET_S * 1e6:
            return
        if self._is_disturbed():
            self.has_moved = True
            return
        if fixes[-1].at_us - fixes[0].at_us < 0.7 * REST_FOUND_S * 1e6:
            return
        if self.has_moved:
            mean_mps = math.hypot(fmean(each.vx_mps for each in fixes), fmean(each.vy_mps for each in fixes))
            spread_mps = fmean(each.std_mps for each in fixes) / math.sqrt(len(fixes))
            is_found = mean_mps <= min(REST_FOUND_SIGMAS * spread_mps, REST_FOUND_MPS - REST_FOUND_SIGMAS * spread_mps)
        else:
            is_found = _mean_speed_sigmas(fixes) <= REST_LOST_SIGMAS and _mean_speed_sigmas(recent) <= REST_LOST_SIGMAS
        if is_found:
            self.at_rest = True
            _, ahead_mps2, left_mps2, _ = zip(*self._motion, strict=True)
            self._rest_accel_mps2 = fmean(ahead_mps2), fmean(left_mps2)
            self._rest_position_m = fmean(each.x_m for each in fixes), fmean(each.y_m for each in fixes)

    def _end_rest(self, *, by_imu: bool) -> None:
        self.at_rest, self.has_moved = False, self.has_moved or by_imu
        self._rest_accel_mps2 = (0.0, 0.0)
        self._fixes.clear()
        self._motion.clear()

    def _is_disturbed(self) -> bool:
        """Whether the window of IMU steps shows shaking, a push or a turn, or lacks the noise of a working IMU."""
        at_us, ahead_mps2, left_mps2, yaw_rate_radps = zip(*self._motion, strict=True)
        push_mps2 = math.hypot(
            fmean(ahead_mps2) - self._rest_accel_mps2[0], fmean(left_mps2) - self._rest_accel_mps2[1]
        )
        if self.at_rest:
            is_pushed = push_mps2 * (at_us[-1] - at_us[0]) * 1e-6 > MAX_PUSH_MPS
        else:
            is_pushed = push_mps2 > MAX_TILT_MPS2
        return (
            is_pushed
            or not 0.0 < max(ahead_mps2) - min(ahead_mps2) <= MAX_ACCEL_RANGE_MPS2
            or not 0.0 < max(left_mps2) - min(left_mps2) <= MAX_ACCEL_RANGE_MPS2
            or abs(fmean(yaw_rate_radps)) > MAX_TURN_RADPS
        )


def _mean_speed_sigmas(fixes: Collection[MapFix]) -> float:
    """Mean speed of the fixes in its standard deviations, taking their errors as independent."""
    vx_mps, vy_mps = fmean(each.vx_mps for each in fixes), fmean(each.vy_mps for each in fixes)
    std_mps = fmean(each.std_mps for each in fixes) / math.sqrt(len(fixes))
    return math.hypot(vx_mps, vy_mps) / std_mps
