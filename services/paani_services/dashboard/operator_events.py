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

MODE_REFUSALS = {
    m.ModeRefusal.NOT_HOLDER: "another hand holds the wheel",
    m.ModeRefusal.NOT_ALLOWED: "this client may only stop the boat",
    m.ModeRefusal.NO_POSITION: "the position is not known well enough",
    m.ModeRefusal.NO_HOME: "home is not known yet: it is where the boat was first free to move",
    m.ModeRefusal.NO_MISSION: "there is neither a mission nor a route",
    m.ModeRefusal.NOT_ARMED: "the boat is not armed",
    m.ModeRefusal.NOT_MANUAL: "the boat is not driven by hand",
}

REQUESTERS = {"dashboard": "the page", "stop": "paani stop", "button": "the button", "arm": "paani up"}
OVERRIDE_ENDS = {
    m.OverrideEnd.NONE: "the operator's process does not say why",
    m.OverrideEnd.EXPIRED: "its time is over",
    m.OverrideEnd.ORDERED: "its hand ordered a mode",
    m.OverrideEnd.TAKEN: "another hand took the wheel",
    m.OverrideEnd.SILENT: "its hand was not heard any more",
    m.OverrideEnd.DISARMED: "the boat is no longer armed",
}


def describe_operator_change(before: m.OperatorState | None, now: m.OperatorState, now_us: int) -> tuple[Event, ...]:
    """Lines for the page's log: what the operator did, and that an override of the advice has ended."""
    lines = (_describe_act(before, now, now_us), _describe_override_end(before, now, now_us))
    return tuple(line for line in lines if line is not None)


def name_requester(process: str) -> str:
    """Who asks by that process, in words; a client that has none goes by its process's name."""
    return REQUESTERS.get(process, process)


def _describe_act(before: m.OperatorState | None, now: m.OperatorState, now_us: int) -> Event | None:
    """A line when the operator has stopped, armed, disarmed or ordered something else."""
    if before is None or before.epoch != now.epoch:
        return Event(now_us, "info", "the operator's process is here: not armed") if not now.armed else None
    if now.stops != before.stops:
        kept = "" if now.latch_kept else "; it could not be written to disk"
        return Event(now_us, "stop", f"STOP requested by {name_requester(now.by)}{kept}")
    if now.armed and not before.armed:
        return Event(now_us, "warn", f"armed by {name_requester(now.by)}")
    if before.armed and not now.armed:
        return Event(now_us, "warn", "disarmed: the page's process has gone or begun again")
    return _describe_wheel_change(before, now, now_us)


def _describe_override_end(before: m.OperatorState | None, now: m.OperatorState, now_us: int) -> Event | None:
    if before is None or before.override_ms == 0.0 or now.override_ms > 0.0:
        return None
    is_same = before.epoch == now.epoch
    why = OVERRIDE_ENDS[now.override_end] if is_same else "the operator's process has begun again"
    return Event(now_us, "warn", f"the advice is no longer overridden: {why}")


def _describe_wheel_change(before: m.OperatorState, now: m.OperatorState, now_us: int) -> Event | None:
    """A line for another mode, an override of the advice, or another hand at the wheel."""
    if now.override_ms > 0.0 and before.override_ms == 0.0:
        return Event(now_us, "warn", f"{name_requester(now.wheel_by)} overrides the advice")
    if (now.mode, now.mode_since_us) != (before.mode, before.mode_since_us):
        is_let_go = before.mode is m.DriveMode.MANUAL and now.mode is m.DriveMode.IDLE
        why = "driving by hand has ended" if is_let_go else f"ordered by {name_requester(now.wheel_by)}"
        return Event(now_us, "warn" if now.mode is m.DriveMode.MANUAL else "info", f"{now.mode.capitalize()}: {why}")
    if now.mission_us != before.mission_us:
        return Event(now_us, "info", f"another mission is in force, sent by {name_requester(now.mission_answered_by)}")
    if (now.wheel_by, now.wheel_hand) != (before.wheel_by, before.wheel_hand):
        return Event(now_us, "info", f"the wheel is in another hand of {name_requester(now.wheel_by)}")
    return None
