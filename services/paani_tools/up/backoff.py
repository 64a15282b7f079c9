"""How long to wait before a process is started again."""

from __future__ import annotations

import random

FIRST_S = 0.5  # with the start itself, longer than the thrust adapter's patience: every death stops the boat
LONGEST_S = 10.0
STABLE_S = 10.0
JITTER_FRAC = 0.2


class Backoff:
    """Doubles from 0.5 s to 10 s; a life of 10 s or more begins again at 0.5 s."""

    def __init__(self, rng: random.Random) -> None:
        self._rng = rng
        self._delay_s = FIRST_S
        self.failures = 0

    def after(self, lived_s: float) -> float:
        """Delay [s] after a life of `lived_s`, jittered by 20 % so that processes do not start in step."""
        if lived_s >= STABLE_S:
            self.failures = 0
        if self.failures == 0:
            self._delay_s = FIRST_S
        delay_s, self._delay_s = self._delay_s, min(2.0 * self._delay_s, LONGEST_S)
        self.failures += 1
        return min(delay_s * self._rng.uniform(1.0 - JITTER_FRAC, 1.0 + JITTER_FRAC), LONGEST_S)
