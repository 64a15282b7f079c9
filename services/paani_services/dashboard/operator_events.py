"""Lines of the page's log, and answers to its requests, from the state of the operator's process. Pure."""

from __future__ import annotations

from paani import messages as m
from paani_services.dashboard.hub import Event

REFUSALS = {
    m.ArmRefusal.TOO_SHORT: "held for less than a second",
    m.ArmRefusal.TOO_LONG: "held for more than five seconds",
    m.ArmRefusal.BROKEN: "the hold was interrupted",
    m.ArmRefusal.STOPPED: "a STOP came meanwhile",
    m.ArmRefusal.LATCHED: "a STOP holds, which a hand on the page releases",
    m.ArmRefusal.NOT_WRITTEN: "the STOP latch could not be written to disk",
    m.ArmRefusal.NO_STATION: "the page's process has no pulse",
}


def describe_operator_change(before: m.OperatorState | None, now: m.OperatorState, now_us: int) -> Event | None:
    """A line for the page's log when the operator has stopped, armed or disarmed."""
    if before is None or before.epoch != now.epoch:
        return Event(now_us, "info", "the operator's process is here: not armed") if not now.armed else None
    if now.stops != before.stops:
        kept = "" if now.latch_kept else "; it could not be written to disk"
        return Event(now_us, "stop", f"STOP requested by {now.by}{kept}")
    if now.armed and not before.armed:
        return Event(now_us, "warn", f"armed by {now.by}")
    if before.armed and not now.armed:
        return Event(now_us, "warn", "disarmed: the page's process has gone or begun again")
    return None
