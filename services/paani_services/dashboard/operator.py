"""The operator's word: armed, or stopped until armed again. Pure."""

from __future__ import annotations

import msgspec

from paani.messages import Arming, ThrustApplied, ZeroCause

CLEAR = "clear\n"
STOPPED = "stopped\n"


class Operator(msgspec.Struct, frozen=True, kw_only=True):
    """`stops` counts STOPs of this process; `confirmed_us` is when the plant said that it applies zero."""

    armed: bool = False
    stopped: bool = False
    stops: int = 0
    asked_us: int = 0
    confirmed_us: int = 0


def at_start(latch: str | None, *, arm_at_start: bool) -> Operator:
    """The first word after a start.

    latch: text of the latch file, None where there is none. Anything but a clear latch is a STOP.
    """
    stopped = latch is not None and latch != CLEAR
    return Operator(armed=arm_at_start and not stopped, stopped=stopped)


def stop(operator: Operator, now_us: int) -> Operator:
    """Latch. A repeated STOP keeps the first asking time until it is confirmed."""
    waiting = operator.stopped and operator.asked_us > 0 and operator.confirmed_us == 0
    return Operator(
        armed=False,
        stopped=True,
        stops=operator.stops + 1,
        asked_us=operator.asked_us if waiting else now_us,
    )


def arm(operator: Operator) -> Operator:
    """Arm, which also releases the latch."""
    return Operator(armed=True, stops=operator.stops)


def hear_applied(operator: Operator, applied: ThrustApplied, now_us: int) -> Operator:
    """A STOP is confirmed by the first word from the plant that it holds zero because nobody armed it."""
    waiting = operator.stopped and operator.asked_us > 0 and operator.confirmed_us == 0
    still = applied.left == 0.0 and applied.right == 0.0 and applied.zero_cause is ZeroCause.NOT_ARMED
    if waiting and still:
        return msgspec.structs.replace(operator, confirmed_us=max(now_us, operator.asked_us + 1))
    return operator


def arming(operator: Operator, now_us: int) -> Arming:
    """The message for the bus."""
    return Arming(source_us=now_us, armed=operator.armed and not operator.stopped, stopped=operator.stopped)


def latch_text(operator: Operator) -> str:
    """What the latch file holds for this word."""
    return STOPPED if operator.stopped else CLEAR
