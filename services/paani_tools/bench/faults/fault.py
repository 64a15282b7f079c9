"""What a fault is, and what is expected of the boat."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from enum import StrEnum

import msgspec

from paani_tools.bench.faults.running import Loop

ZERO_S = 0.5  # the longest that thrust may go on, of the paper's thrust adapter
Act = Callable[[Loop], Awaitable[None]]


class Expected(StrEnum):
    """STOPS: no thrust while it lasts, and it goes on by itself. HAND: it stands until a hand arms it again.

    GOES_ON: it may drive on, and needs no hand. MAY_STAND: it may drive on, or stand until a hand arms it.
    """

    STOPS = "stops"
    HAND = "stops, needs a hand"
    GOES_ON = "may go on"
    MAY_STAND = "may go on, or stand"


class Drive(StrEnum):
    """Which drive is hurt: the simulated one, the same with a clock that can be set, board and host apart, one whose
    processes have certificates, or one whose thrust goes through the emulated microcontroller.
    """

    PLAIN = "plain"
    CLOCK = "clock"
    LINK = "link"
    CERTIFICATES = "certificates"
    SERIAL = "serial"


class Fault(msgspec.Struct, frozen=True, kw_only=True):
    """`begin` calls `Loop.mark` as it hurts; after `lasts_s`, `end` returns when the cause is gone.

    zero_s: how soon thrust has to be zero. hurts_adapter: the thrust adapter itself is away, and applies nothing.
    """

    name: str
    expected: Expected
    begin: Act
    end: Act
    lasts_s: float = 0.0
    zero_s: float = ZERO_S
    drive: Drive = Drive.PLAIN
    hurts_adapter: bool = False
