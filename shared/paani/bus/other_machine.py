"""How old what the boat's other machine says is, though the two machines share no time.

On a boat of two machines each message says when it left, by a clock of its machine that is never set. One process a
side also echoes, in its pulse, the newest such stamp that it has heard from the other side, and its own clock when that
came. What was echoed had been said before it was heard, so the other clock cannot be further ahead of this one than

    heard_us - echo_us

and by this bound nothing is taken for younger than it is. Delay either way, a cut link or a late thread only make the
bound larger, and with it everything older. Wall clocks take no part: they may differ by any amount, and be set.
"""

from __future__ import annotations

import math

from paani import messages as m
from paani.clock import Clock

MAX_DRIFT = 2e-3  # of one clock against the other: two crystals of 100 ppm, each disciplined by up to 500 ppm, and room
MAX_ECHO_AGE_US = 10_000_000  # an older echo says little; one of the future is of before this machine was started


class OtherMachine:
    """What this process knows of the other machine's clock. Any thread may note and ask."""

    def __init__(self, steady: Clock) -> None:
        """steady: this machine's clock that is never set, the one of its messages' `steady_us`."""
        self._steady = steady
        self._bound: tuple[int, int] | None = None  # how far the other clock may be ahead, and when it was so [us]
        self.echo = (0, 0)
        """The newest stamp of the other machine by its clock, and when it came [us]: what this side echoes."""

    def note_pulse(self, pulse: m.Pulse) -> None:
        """A pulse of the process that echoes on the other machine has come."""
        now_us = self._steady.now_us()
        if not pulse.steady_us:
            return
        self.echo = (pulse.steady_us, now_us)
        if not pulse.echo_us or not 0 <= now_us - pulse.echo_us <= MAX_ECHO_AGE_US:
            return
        bound, known = (pulse.heard_us - pulse.echo_us, pulse.echo_us), self._bound
        if known is None or _lead_us(bound, now_us) <= _lead_us(known, now_us):
            self._bound = bound

    def shift_us(self, message: m.Message, now_us: int) -> int:
        """What to add to the stamps of a message that has come now, so that they are by this machine's clock, `now_us`.

        0, which is to judge by wall clock, as long as nothing was echoed, and after a message has refuted the bound by
        a stamp of the future, as when this machine slept.
        """
        bound, steady_us = self._bound, self._steady.now_us()
        if bound is None or not message.steady_us:
            return 0
        transit_us = steady_us + _lead_us(bound, steady_us) - message.steady_us
        if transit_us < 0:
            self._bound = None
            return 0
        return now_us - math.ceil(transit_us * (1.0 + MAX_DRIFT)) - message.sent_us


def _lead_us(bound: tuple[int, int], now_us: int) -> int:
    lead_us, since_us = bound
    return lead_us + round(MAX_DRIFT * (now_us - since_us)) + 1
