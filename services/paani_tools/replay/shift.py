"""Moves recorded messages to another time. Pure.

Every Unix stamp (`..._us`) in a message moves by one map of time, so at normal speed ages, echoes and references stay
what they were; at another speed they scale as all time does. What is no Unix time stays: simulated time, a recording's
own time, the plant's own clock. Epochs (Unix milliseconds) move as stamps do, so none lies in the future.
"""

from __future__ import annotations

import re

import msgspec

# A quote may be escaped: a step carries its state as text. Sixteen digits are Unix microseconds since 2001, thirteen
# are milliseconds.
STAMP = re.compile(rb'(_us\\*":)(\d{16})(?!\d)')
EPOCH = re.compile(rb'(epoch\\*":)(\d{13})(?!\d)')


class TimeShift(msgspec.Struct, frozen=True):
    """Recorded time `from_us` is replayed at `to_us`, `speed` times as fast."""

    from_us: int
    to_us: int
    speed: float

    def shift_us(self, stamp_us: int) -> int:
        """The replayed time of a recorded one."""
        if self.speed == 1.0:
            return stamp_us - self.from_us + self.to_us
        return self.to_us + round((stamp_us - self.from_us) / self.speed)

    def shift_message(self, data: bytes) -> bytes:
        """A message in JSON, moved."""
        data = STAMP.sub(lambda found: found[1] + b"%d" % max(0, self.shift_us(int(found[2]))), data)
        return EPOCH.sub(lambda found: found[1] + b"%d" % max(0, self.shift_us(int(found[2]) * 1000) // 1000), data)
