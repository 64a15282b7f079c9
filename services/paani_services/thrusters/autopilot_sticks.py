"""The sticks that make an ArduPilot Rover give no more thrust than was decided: its mixer, turned round. Pure.

ArduPilot takes a stick for a pulse of its receiver (`manual_override`), and what a pulse means is in the calibration of
that receiver: travel, rest and dead zone of the channel. It reads whole percents of the stick ahead, and hundredths of
a degree of 45 of the stick to starboard, both towards zero; a side is their sum, the other their difference.
"""

from __future__ import annotations

import math
from typing import NamedTuple

LEAST_TRAVEL_US = 100  # to either side of rest: one microsecond a percent
PULSES_US = (800, 2200)  # of a receiver
STEERING_STEPS = 4500  # of the stick to starboard
SLACK = 1e-9


class Sticks(NamedTuple):
    """MANUAL_CONTROL: `ahead` and `starboard` from -1000 to 1000."""

    ahead: int
    starboard: int


class Channel(NamedTuple):
    """The calibration of one channel of the autopilot's receiver, in microseconds."""

    least: int
    most: int
    rest: int
    dead_zone: int
    is_reversed: bool

    @property
    def problem(self) -> str:
        """Why nothing, or not both ways, can be said by it; empty where it can."""
        if not PULSES_US[0] <= self.least < self.rest < self.most <= PULSES_US[1] or self.dead_zone < 0:
            return f"{self.least}, {self.rest} and {self.most} us are no travel of a stick"
        if min(self.travel(1), self.travel(-1)) < LEAST_TRAVEL_US:
            return f"between {self.least}, {self.rest} and {self.most} us a stick has too little travel"
        return ""

    def travel(self, sign: int) -> int:
        """Microseconds from the end of the dead zone to the end, for sticks of this sign."""
        is_above = (sign > 0) is not self.is_reversed
        return (self.most - self.rest if is_above else self.rest - self.least) - self.dead_zone

    def axis(self, step_us: int) -> int:
        """The stick whose pulse is so far beyond the dead zone, and at 0 at rest."""
        pulse_us = self.rest
        if step_us:
            beyond_us = self.dead_zone + abs(step_us)
            pulse_us += beyond_us if (step_us > 0) is not self.is_reversed else -beyond_us
        span_us = self.most - self.least
        return -((self.least - pulse_us) * 2000 // span_us) - 1000  # the autopilot drops what is below a microsecond


class Mixed(NamedTuple):
    """Sticks, and what the autopilot makes of them."""

    sticks: Sticks
    left: float
    right: float


class StickMixer:
    """Of an autopilot with these channels, whose throttle goes up to `most_ahead`."""

    def __init__(self, ahead: Channel, starboard: Channel, most_ahead: float = 1.0) -> None:
        self._ahead, self._starboard = ahead, starboard
        self._most_percent = math.floor(most_ahead * 100 + SLACK)
        self.still = Mixed(Sticks(ahead.axis(0), starboard.axis(0)), 0.0, 0.0)

    def mix(self, left: float, right: float) -> Mixed:
        """The most thrust that is on neither side more than this, nor the other way, to half a microsecond."""
        mean = (left + right) / 2
        percent = min(math.floor(abs(mean) * 100 + SLACK), self._most_percent) * (-1 if mean < 0 else 1)
        ahead = percent / 100
        port, starboard = sorted((0.0, left)), sorted((0.0, right))
        least, most = max(port[0] - ahead, ahead - starboard[1]), min(port[1] - ahead, ahead - starboard[0])
        turning = min(max((left - right) / 2, least), most)
        sign = -1 if turning < 0 else 1
        step_us = sign * round(abs(turning) * self._starboard.travel(sign))
        turned = self._turned(step_us)
        ahead_us = -(-abs(percent) * self._ahead.travel(1 if percent > 0 else -1) // 100)
        axes = Sticks(self._ahead.axis(-ahead_us if percent < 0 else ahead_us), self._starboard.axis(step_us))
        return Mixed(axes, ahead + turned, ahead - turned)

    def _turned(self, step_us: int) -> float:
        travel_us = self._starboard.travel(1 if step_us > 0 else -1)
        return math.copysign(STEERING_STEPS * abs(step_us) // travel_us / STEERING_STEPS, step_us)
