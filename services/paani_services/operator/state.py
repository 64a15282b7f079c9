"""State of the operator: armed, or stopped until armed again, and the hold that would arm. Pure.

Whoever arms holds a button for one to five seconds, by the clock of this process: a client only says, again and again,
that it is held. A client that falls silent has let it go. Nothing but such a hold arms.
"""

from __future__ import annotations

import msgspec
from msgspec.structs import replace

from paani import messages as m
from paani.keys import STATION, STOPPING_CLIENTS

HOLD_MIN_S, HOLD_MAX_S = 1.0, 5.0
REFRESH_MAX_S = 0.6  # three times what a page takes to say it again
STATION_SILENT_S = 5.0  # thrust is zero long before: its pulse is vital (plant.adapter.require_pulses)

# Text of the latch file. Only CLEAR is none: whoever was armed when the process ended has not ended in good order.
CLEAR, ARMED, STOPPED = "clear\n", "armed\n", "stopped\n"
MAY_RELEASE_LATCH = frozenset({STATION})  # a hand on the page; what a command latched, a command may not release


class Hold(msgspec.Struct, frozen=True):
    """A button that is held: whose, since when, and when that was said last [us]."""

    client: str
    press: int
    begun_us: int
    refreshed_us: int


class Ended(msgspec.Struct, frozen=True):
    """The press that ended last, and why it did not arm."""

    client: str = ""
    press: int = 0
    refusal: m.ArmRefusal = m.ArmRefusal.NONE


class Operator(msgspec.Struct, frozen=True, kw_only=True):
    """`station_epoch`: the start of the page's process for which the boat was armed; `stops` counts this process's."""

    armed: bool = False
    stopped: bool = True
    by: str = ""
    station_epoch: int = 0
    stops: int = 0
    asked_us: int = 0
    confirmed_us: int = 0
    hold: Hold | None = None
    ended: Ended = Ended()


def initial_state(latch: str | None) -> Operator:
    """The state after a start: never armed, and stopped unless the latch file (None: missing) is clear."""
    return Operator(stopped=latch != CLEAR)


def latch_stop(operator: Operator, client: str, now_us: int) -> Operator:
    """Latch a STOP, which ends every hold. A repeated one keeps the time of the first until that is confirmed."""
    held = operator.hold
    return Operator(
        by=client,
        stops=operator.stops + 1,
        asked_us=operator.asked_us if awaits_zero(operator) else now_us,
        ended=operator.ended if held is None else Ended(held.client, held.press, m.ArmRefusal.STOPPED),
    )


def hold(operator: Operator, client: str, press: int, now_us: int) -> Operator:
    """A client says that its button is held: the hold begins, or goes on where it was never silent for too long.

    One hold at a time; a press that has ended does not begin again. Of clients that may only stop it is passed over.
    """
    if client in STOPPING_CLIENTS:
        return operator
    held = operator.hold
    if held is not None and (held.client, held.press) == (client, press):
        if is_silent(held, now_us):
            return refuse(operator, client, press, m.ArmRefusal.BROKEN)
        return replace(operator, hold=Hold(client, press, held.begun_us, now_us))
    if held is not None and not is_silent(held, now_us):
        return operator
    if (operator.ended.client, operator.ended.press) == (client, press):
        return operator
    return replace(operator, hold=Hold(client, press, now_us, now_us))


def judge_release(operator: Operator, client: str, press: int, now_us: int) -> m.ArmRefusal:
    """Why letting this press go does not arm; NONE where it may."""
    held = operator.hold
    if held is None or (held.client, held.press) != (client, press) or is_silent(held, now_us):
        return m.ArmRefusal.BROKEN
    held_s = (now_us - held.begun_us) * 1e-6
    if held_s < HOLD_MIN_S:
        return m.ArmRefusal.TOO_SHORT
    if held_s > HOLD_MAX_S:
        return m.ArmRefusal.TOO_LONG
    if operator.stopped and client not in MAY_RELEASE_LATCH:
        return m.ArmRefusal.LATCHED
    return m.ArmRefusal.NONE


def refuse(operator: Operator, client: str, press: int, refusal: m.ArmRefusal) -> Operator:
    """This press ends without arming."""
    held = operator.hold
    is_its = held is not None and (held.client, held.press) == (client, press)
    return replace(operator, hold=None if is_its else held, ended=Ended(client, press, refusal))


def arm(operator: Operator, client: str, press: int, station_epoch: int) -> Operator:
    """Arm, which also releases the latch."""
    return Operator(
        armed=True, stopped=False, by=client, station_epoch=station_epoch, stops=operator.stops,
        ended=Ended(client, press),
    )  # fmt: skip


def follow_station(operator: Operator, epoch: int, silent_s: float) -> Operator:
    """Disarm where the page's process for which the boat was armed has begun again, or is long silent."""
    if operator.armed and (epoch != operator.station_epoch or silent_s > STATION_SILENT_S):
        return replace(operator, armed=False)
    return operator


def confirm_stop(operator: Operator, applied: m.ThrustApplied, now_us: int) -> Operator:
    """Confirm a STOP by the plant's first report that it applies zero thrust because nobody armed it."""
    is_still = applied.left == 0.0 and applied.right == 0.0 and applied.zero_cause is m.ZeroCause.NOT_ARMED
    if awaits_zero(operator) and is_still:
        return replace(operator, confirmed_us=max(now_us, operator.asked_us + 1))
    return operator


def awaits_zero(operator: Operator) -> bool:
    """Whether a STOP of this process has not been confirmed by zero thrust yet."""
    return operator.stopped and operator.asked_us > 0 and operator.confirmed_us == 0


def is_silent(held: Hold, now_us: int) -> bool:
    """Whether the client has not said for too long that its button is held, or the clock was set since."""
    return not 0 <= now_us - held.refreshed_us <= REFRESH_MAX_S * 1e6


def latch_text(operator: Operator) -> str:
    """Text of the latch file for this state."""
    return STOPPED if operator.stopped else ARMED if operator.armed else CLEAR


def arming_message(operator: Operator, now_us: int) -> m.Arming:
    """What the thrust adapter is told."""
    armed = operator.armed and not operator.stopped
    return m.Arming(source_us=now_us, armed=armed, stopped=operator.stopped, mode_ordered=True)


def state_message(operator: Operator, now_us: int, *, latch_kept: bool) -> m.OperatorState:
    """What everybody else is told."""
    held = operator.hold
    is_held = held is not None and not is_silent(held, now_us)
    return m.OperatorState(
        source_us=now_us,
        armed=operator.armed and not operator.stopped,
        stopped=operator.stopped,
        by=operator.by,
        latch_kept=latch_kept,
        stops=operator.stops,
        asked_us=operator.asked_us,
        confirmed_us=operator.confirmed_us,
        hold_by=held.client if held is not None and is_held else "",
        held_ms=max(0, now_us - held.begun_us) * 1e-3 if held is not None and is_held else 0.0,
        press_by=operator.ended.client,
        press=operator.ended.press,
        refusal=operator.ended.refusal,
    )
