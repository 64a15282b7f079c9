"""Sessions and sequence numbers of frames, by which the microcontroller tells a newer frame from a replayed one."""

from __future__ import annotations

import random

from paani.microcontroller.payloads import MAX_SEQ, MAX_SESSION, McuStatus

REORDERING_MS = 1000  # the router delivers notifications milliseconds out of order; a restart sets the clock to zero


class FrameNumbers:
    """The numbers of the next frame. A microcontroller that restarted is sent a session of another number."""

    def __init__(self, rng: random.Random) -> None:
        self._rng = rng
        self._newest: McuStatus | None = None
        self.session = rng.randint(1, MAX_SESSION)
        self.seq = 0

    def advance(self) -> tuple[int, int]:
        """Session and sequence number of the next frame."""
        self.seq = self.seq % MAX_SEQ + 1
        return self.session, self.seq

    def observe(self, status: McuStatus) -> bool:
        """Take in what the microcontroller said; returns whether it has restarted since it last spoke."""
        newest, self._newest = self._newest, status
        if newest is None or not has_restarted(newest, status):
            return False
        self.session = (self.session - 1 + self._rng.randint(1, MAX_SESSION - 1)) % MAX_SESSION + 1
        self.seq = 0
        return True


def has_restarted(before: McuStatus, after: McuStatus) -> bool:
    """Whether the microcontroller started anew between the two; its clock wraps after 49.7 days."""
    return before.boot_count != after.boot_count or elapsed_ms(before, after) < -REORDERING_MS


def is_out_of_order(before: McuStatus, after: McuStatus) -> bool:
    """Whether the second was said before the first."""
    return not has_restarted(before, after) and elapsed_ms(before, after) < 0


def elapsed_ms(before: McuStatus, after: McuStatus) -> int:
    """Time between the two on the microcontroller's clock, of 32 bits: negative where the second is the older."""
    return (after.mcu_ms - before.mcu_ms + 2**31) % 2**32 - 2**31
