"""Whether the boat lies still, when its GPS says otherwise. Pure.

A receiver at a quay shows speeds of decimetres a second, for minutes at a time, and a position that wanders by metres.
No boat starts to move without its IMU feeling it, so rest is kept against the receiver: until the IMU feels a push or a
turn, or speed and place of the fixes both leave what the receiver's own error explains. To find rest after motion was
felt takes more: a quiet IMU, and a mean speed near zero by any receiver's standard.
"""

import math
from collections import deque
from collections.abc import Collection
from statistics import fmean
from typing import NamedTuple

QUIET_S = 2.0  # L5: as long as `stopped_after_s`
MAX_ACCEL_RANGE_MPS2 = 0.5  # between quiet steps: ripples rock a boat at rest; noise alone gives 0.06
MAX_PUSH_MPS = 0.1  # gained in `QUIET_S` over what was felt before
MAX_TILT_MPS2 = 0.15  # a constant that an IMU mounted askew by 0.9 degrees feels
MAX_TURN_RADPS = 0.02
FOUND_S = 5.0  # of fixes whose mean speed is about zero
FOUND_MPS = 0.1  # slower than any speed that the navigator orders
FOUND_SIGMAS, LOST_SIGMAS = 2.5, 4.0  # of the mean speed
AWAY_SIGMAS, STRAYED_SIGMAS = 2.0, 4.0  # of the place: with such a speed, and with any
SETTLE_S = 60.0  # over which the place of rest follows the receiver: a drift above 0.05 m/s leaves it behind


class Felt(NamedTuple):
    """Level acceleration [m/s^2] and yaw rate [rad/s] of one step, biases taken off."""

    at_us: int
    ahead_mps2: float
    left_mps2: float
    yaw_rate_radps: float


class Shown(NamedTuple):
    """Place and velocity of one fix in the map frame, with the standard deviations of both."""

    at_us: int
    x_m: float
    y_m: float
    vx_mps: float
    vy_mps: float
    std_m: float
    std_mps: float


class RestWatch:
    """Hears every step and every fix; `at_rest` is its judgement."""

    def __init__(self) -> None:
        self._felt: deque[Felt] = deque()
        self._shown: deque[Shown] = deque()
        self._usual = (0.0, 0.0)  # acceleration felt at rest
        self._place_m = (0.0, 0.0)
        self._has_moved = False
        self.at_rest = False

    def feel(self, felt: Felt) -> None:
        """One step of the IMU."""
        self._felt.append(felt)
        while felt.at_us - self._felt[0].at_us > QUIET_S * 1e6:
            self._felt.popleft()
        if self.at_rest and self._is_disturbed():
            self._leave(felt_it=True)

    def show(self, fix: Shown) -> None:
        """One fix."""
        self._shown.append(fix)
        while fix.at_us - self._shown[0].at_us > FOUND_S * 1e6:
            self._shown.popleft()
        recent = [each for each in self._shown if fix.at_us - each.at_us <= QUIET_S * 1e6]
        if self.at_rest:
            self._keep_rest(fix, recent)
        elif self._felt:
            self._look_for_rest(recent)

    def _keep_rest(self, fix: Shown, recent: list[Shown]) -> None:
        x_m, y_m = self._place_m
        strayed = math.hypot(fix.x_m - x_m, fix.y_m - y_m) / fix.std_m
        if strayed > STRAYED_SIGMAS or (strayed > AWAY_SIGMAS and _sigmas(recent) > LOST_SIGMAS):
            self._leave(felt_it=False)
            return
        since_s = (fix.at_us - self._shown[-2].at_us) * 1e-6 if len(self._shown) > 1 else 0.0
        follow = 1.0 - math.exp(-since_s / SETTLE_S)
        self._place_m = (x_m + follow * (fix.x_m - x_m), y_m + follow * (fix.y_m - y_m))

    def _look_for_rest(self, recent: list[Shown]) -> None:
        """A boat never felt to move is believed to lie still as soon as its receiver allows that."""
        shown = self._shown
        if self._felt[-1].at_us - self._felt[0].at_us < 0.9 * QUIET_S * 1e6:
            return
        if self._is_disturbed():
            self._has_moved = True
            return
        if shown[-1].at_us - shown[0].at_us < 0.7 * FOUND_S * 1e6:
            return
        if self._has_moved:
            mean_mps = math.hypot(fmean(each.vx_mps for each in shown), fmean(each.vy_mps for each in shown))
            spread_mps = fmean(each.std_mps for each in shown) / math.sqrt(len(shown))
            found = mean_mps <= min(FOUND_SIGMAS * spread_mps, FOUND_MPS - FOUND_SIGMAS * spread_mps)
        else:
            found = _sigmas(shown) <= LOST_SIGMAS and _sigmas(recent) <= LOST_SIGMAS
        if found:
            self.at_rest = True
            _, ahead, left, _ = zip(*self._felt, strict=True)
            self._usual = fmean(ahead), fmean(left)
            self._place_m = fmean(each.x_m for each in shown), fmean(each.y_m for each in shown)

    def _leave(self, *, felt_it: bool) -> None:
        self.at_rest, self._has_moved = False, self._has_moved or felt_it
        self._usual = (0.0, 0.0)
        self._shown.clear()
        self._felt.clear()

    def _is_disturbed(self) -> bool:
        """Shaken, pushed or turned; or without the noise that an IMU has while it works."""
        at_us, ahead, left, yaw_rate = zip(*self._felt, strict=True)
        push_mps2 = math.hypot(fmean(ahead) - self._usual[0], fmean(left) - self._usual[1])
        if self.at_rest:
            pushed = push_mps2 * (at_us[-1] - at_us[0]) * 1e-6 > MAX_PUSH_MPS
        else:
            pushed = push_mps2 > MAX_TILT_MPS2
        return (
            pushed
            or not 0.0 < max(ahead) - min(ahead) <= MAX_ACCEL_RANGE_MPS2
            or not 0.0 < max(left) - min(left) <= MAX_ACCEL_RANGE_MPS2
            or abs(fmean(yaw_rate)) > MAX_TURN_RADPS
        )


def _sigmas(fixes: Collection[Shown]) -> float:
    """How many standard deviations the mean velocity is from zero, were the errors independent."""
    vx_mps, vy_mps = fmean(each.vx_mps for each in fixes), fmean(each.vy_mps for each in fixes)
    std_mps = fmean(each.std_mps for each in fixes) / math.sqrt(len(fixes))
    return math.hypot(vx_mps, vy_mps) / std_mps
