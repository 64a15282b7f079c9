"""From an advisory to what the microcontroller is sent: bounded symbols, never a force or a speed. Pure.

A direction of seven, a reason of a fixed list, three risks in percent, and ages. There is no other field that a value
could leave by.
"""

from __future__ import annotations

import math

import msgspec

from paani import messages as m
from paani.microcontroller.payloads import UNKNOWN_RISK, Guide

MAX_FUTURE_US = 100_000  # clocks of one machine; a stamp further ahead is no stamp
MAX_AGE_MS = 0xFFFF
STILL = (m.Direction.STOP, m.Direction.NO_DATA)

# The microcontroller has these numbers burnt in: a number is never given to another reason. 0 is unknown.
REASON_CODES = {
    m.Reason.CENTER_CLEAR: 1,
    m.Reason.CENTER_RISK: 2,
    m.Reason.CENTER_OCCUPIED: 3,
    m.Reason.CENTER_VESSEL: 4,
    m.Reason.CENTER_EDGE_INCURSION: 5,
    m.Reason.TURN_RETAINED: 6,
    m.Reason.TIE_KEPT_SIDE: 7,
    m.Reason.TIE_STARBOARD: 8,
    m.Reason.NO_SAFE_SIDE: 9,
    m.Reason.NO_SIDE_UNOCCUPIED: 10,
    m.Reason.NO_SIDE_FOR_LONG: 11,
    m.Reason.STALE_EVIDENCE: 12,
    m.Reason.FUTURE_EVIDENCE: 13,
    m.Reason.UNUSABLE_IMAGE: 14,
    m.Reason.MALFORMED_EVIDENCE: 15,
    m.Reason.NO_EVIDENCE: 16,
}


class Symbols(msgspec.Struct, frozen=True):
    """What is to be shown. `risks_percent`: left, centre, right; `age_ms`: of the picture behind a direction."""

    direction: m.Direction
    reason: m.Reason
    risks_percent: tuple[int, int, int] = (UNKNOWN_RISK, UNKNOWN_RISK, UNKNOWN_RISK)
    age_ms: int = 0

    def is_shown_like(self, other: Symbols) -> bool:
        """Whether direction and reason are the same, so that the other need not go out at once."""
        return (self.direction, self.reason) == (other.direction, other.reason)


def symbols_of(advisory: m.Advisory | None, received_us: int, now_us: int, lease_ms: int) -> Symbols:
    """What to show of the newest advisory, received at `received_us`.

    Without one: NO_DATA. One whose picture, or whose receipt, is as old as the lease shows STOP: what is stale moves
    nobody. STOP itself ages by its receipt alone, since an advisor without pictures repeats it.
    """
    if advisory is None:
        return Symbols(m.Direction.NO_DATA, m.Reason.NO_EVIDENCE)
    if advisory.source_us > now_us + MAX_FUTURE_US or received_us > now_us + MAX_FUTURE_US:
        return Symbols(m.Direction.STOP, m.Reason.FUTURE_EVIDENCE)
    dated_us = received_us if advisory.direction in STILL else min(advisory.source_us, received_us)
    age_ms = max(0, math.ceil((now_us - dated_us) / 1000))
    if age_ms >= lease_ms:
        return Symbols(m.Direction.STOP, m.Reason.STALE_EVIDENCE)
    risks = tuple(percent_of(lane.risk) for lane in (advisory.left, advisory.center, advisory.right))
    is_judged = advisory.reason is not m.Reason.NO_EVIDENCE
    known = (risks[0], risks[1], risks[2]) if is_judged else (UNKNOWN_RISK, UNKNOWN_RISK, UNKNOWN_RISK)
    return Symbols(advisory.direction, advisory.reason, known, age_ms)


def percent_of(risk: float) -> int:
    """0 to 100; what is no fraction is unknown."""
    return round(100 * risk) if 0.0 <= risk <= 1.0 else UNKNOWN_RISK


def guide_of(symbols: Symbols, session: int, seq: int, lease_ms: int) -> Guide:
    """The payload that carries them."""
    return Guide(
        direction=symbols.direction,
        session=session,
        seq=seq,
        lease_ms=lease_ms,
        reason=REASON_CODES.get(symbols.reason, 0),
        risks=symbols.risks_percent,
        age_ms=min(symbols.age_ms, MAX_AGE_MS),
    )
