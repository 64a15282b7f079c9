"""State of the operator: armed, or stopped until armed again. Pure."""

from __future__ import annotations

import msgspec

from paani.messages import Arming, ThrustApplied, ZeroCause

CLEAR = "clear\n"
STOPPED = "stopped\n"


class OperatorState(msgspec.Struct, frozen=True, kw_only=True):
    """`stops` counts the STOPs of this process; `confirmed_us` is when the plant reported zero thrust."""

    armed: bool = False
    stopped: bool = False
    stops: int = 0
    asked_us: int = 0
    confirmed_us: int = 0


def initial_state(latch: str | None, *, arm_at_start: bool) -> OperatorState:
    """The state after a start.

    latch: text of the latch file, None where there is none. Anything but a clear latch is a STOP.
    """
    stopped = latch is not None and latch != CLEAR
    return OperatorState(armed=arm_at_start and not stopped, stopped=stopped)


def latch_stop(operator: OperatorState, now_us: int) -> OperatorState:
    """Latch a STOP. A repeated one keeps the time of the first until that is confirmed."""
    waiting = operator.stopped and operator.asked_us > 0 and operator.confirmed_us == 0
    return OperatorState(
        armed=False,
        stopped=True,
        stops=operator.stops + 1,
        asked_us=operator.asked_us if waiting else now_us,
    )


def arm(operator: OperatorState) -> OperatorState:
    """Arm, which also releases the latch."""
    return OperatorState(armed=True, stops=operator.stops)


def confirm_stop(operator: OperatorState, applied: ThrustApplied, now_us: int) -> OperatorState:
    """Confirm a STOP by the plant's first report that it applies zero thrust because nobody armed it."""
    waiting = operator.stopped and operator.asked_us > 0 and operator.confirmed_us == 0
    is_still = applied.left == 0.0 and applied.right == 0.0 and applied.zero_cause is ZeroCause.NOT_ARMED
    if waiting and is_still:
        return msgspec.structs.replace(operator, confirmed_us=max(now_us, operator.asked_us + 1))
    return operator


def arming_message(operator: OperatorState, now_us: int) -> Arming:
    """The message for the bus."""
    return Arming(source_us=now_us, armed=operator.armed and not operator.stopped, stopped=operator.stopped)


def latch_text(operator: OperatorState) -> str:
    """Text of the latch file for this state."""
    return STOPPED if operator.stopped else CLEAR
