"""What changes about the boat, said to ground stations as STATUSTEXT. Pure but for what was said before."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from paani import messages as m
from paani.clock import has_passed
from paani_services.mavlink.codec import dialect
from paani_services.mavlink.snapshot import Snapshot

MAX_TEXT_BYTES = 50  # of the field
QUIET_S = 5.0  # what comes and goes is said once in so long
CRITICAL, ERROR = dialect.MAV_SEVERITY_CRITICAL, dialect.MAV_SEVERITY_ERROR
WARNING, NOTICE, INFO = dialect.MAV_SEVERITY_WARNING, dialect.MAV_SEVERITY_NOTICE, dialect.MAV_SEVERITY_INFO

INHIBIT_TEXTS = {
    m.Inhibit.NO_CLOCK: "no clock of the boat's plant",
    m.Inhibit.CLOCK_STOPPED: "the plant's clock stands still",
    m.Inhibit.NO_ODOMETRY: "position unknown",
    m.Inhibit.STALE_ODOMETRY: "position is old",
    m.Inhibit.UNHEALTHY_ODOMETRY: "position too uncertain to steer by",
    m.Inhibit.NO_ADVISORY: "no advice from the camera yet",
    m.Inhibit.STALE_ADVISORY: "advice from the camera is old",
    m.Inhibit.ADVISED_STOP: "stopped: advised by the camera",
    m.Inhibit.ADVISED_NO_DATA: "camera gives no data",
    m.Inhibit.TURN_CAPPED: "stopped: advised turn is too long",
    m.Inhibit.MAP_MOVED: "map begins elsewhere: start PAANI anew",
    m.Inhibit.NO_ROUTE: "no route to follow",
    m.Inhibit.ROUTE_FINISHED: "route finished",
    m.Inhibit.NO_FREE_PATH: "stopped: no free path",
    m.Inhibit.HOLDING: "holding station",
    m.Inhibit.MISSION_DONE: "mission done",
    m.Inhibit.OUTSIDE_FENCE: "stopped: at or outside the fence",
    m.Inhibit.WRONG_DOMAIN: "message of another domain heard",
    m.Inhibit.NO_COMMAND: "no order from the navigator",
    m.Inhibit.STALE_COMMAND: "order of the navigator is old",
    m.Inhibit.COMMAND_INVALID: "order of the navigator is invalid",
    m.Inhibit.NO_ORDER: "no mode ordered by the operator process",
    m.Inhibit.STALE_ORDER: "order of the operator process is old",
    m.Inhibit.IDLE: "idle: no thrust until a mode is asked for",
    m.Inhibit.NEUTRAL: "stick in neutral",
    m.Inhibit.BLOCKED_AHEAD: "no thrust ahead: blocked",
}
# Of an armed boat: nothing, what its order says anyway, and what the adapter has not heard yet.
UNREMARKABLE = frozenset({m.ZeroCause.NONE, m.ZeroCause.NOT_ENABLED, m.ZeroCause.NOT_ARMED})
CALM = frozenset({m.Inhibit.ROUTE_FINISHED, m.Inhibit.HOLDING, m.Inhibit.MISSION_DONE, m.Inhibit.NEUTRAL})


def statustext(severity: int, text: str) -> Any:
    """One text, cut to the field."""
    return dialect.MAVLink_statustext_message(severity, text.encode("ascii", "replace")[:MAX_TEXT_BYTES])


def conditions(snapshot: Snapshot) -> dict[str, tuple[int, str]]:
    """What holds now, worth saying once: severity and text by a name."""
    found: dict[str, tuple[int, str]] = {}
    operator, command, applied = snapshot.operator, snapshot.command, snapshot.applied
    if operator is None:
        found["operator"] = ERROR, "operator process silent: not armed"
    elif snapshot.is_armed:
        found["armed"] = NOTICE, f"armed by {operator.by or 'the operator'}"
    elif operator.stopped:
        found["stopped"] = WARNING, f"STOP by {operator.by or 'an earlier run'}: release it on the page"
    else:
        found["disarmed"] = NOTICE, "disarmed"
    if command is None:
        found["navigator"] = ERROR, "navigator silent"
    for inhibit in command.halt_reasons if command is not None else ():
        if text := INHIBIT_TEXTS.get(inhibit):
            found[inhibit.value] = (INFO if inhibit in CALM else WARNING), text
    for veto in command.vetoes if command is not None and not command.keeps_station else ():
        found[f"veto {veto}"] = WARNING, f"no thrust ahead: {veto.replace('_', ' ').lower()}"
    if applied is None:
        found["adapter"] = ERROR, "thrust adapter silent"
    elif snapshot.is_armed and applied.zero_cause not in UNREMARKABLE:
        found[f"zero {applied.zero_cause}"] = CRITICAL, f"zero thrust: {applied.zero_cause.replace('_', ' ')}"
    return found


class Announcer:
    """Says each condition when it begins, and no more than once in `QUIET_S`."""

    def __init__(self) -> None:
        self._present = frozenset[str]()
        self._said_us: dict[str, int] = {}

    def observe(self, snapshot: Snapshot) -> list[Any]:
        """Texts for what has begun since the last call."""
        now = conditions(snapshot)
        begun = [name for name in now if name not in self._present and self._may_say(name, snapshot.now_us)]
        self._said_us.update(dict.fromkeys(begun, snapshot.now_us))
        self._present = frozenset(now)
        return _texts(now[name] for name in begun)

    def _may_say(self, name: str, now_us: int) -> bool:
        said_us = self._said_us.get(name)
        return said_us is None or has_passed(said_us, QUIET_S * 1e6, now_us)


def summary(snapshot: Snapshot) -> list[Any]:
    """Texts of everything that holds, for a station that has just come."""
    return _texts(conditions(snapshot).values())


def _texts(found: Iterable[tuple[int, str]]) -> list[Any]:
    return [statustext(severity, text) for severity, text in found]
