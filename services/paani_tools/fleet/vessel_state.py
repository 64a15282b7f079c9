"""What the shore knows of one vessel, in one row. Pure."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from enum import StrEnum
from types import MappingProxyType
from typing import Any

import msgspec

from paani import keys
from paani import messages as m

STALE_S = 1.0  # position and thrust come twenty times a second: what is older tells of the past
HEALTH_STALE_S = 3.0
HEADING = (
    "vessel",
    "contact",
    "age [s]",
    "mode",
    "position [m]",
    "m/s",
    "advice",
    "thrust",
    "not moving for",
    "health",
)


class Contact(StrEnum):
    """LIVE: heard within STALE_S. STALE: heard before that. AWAY: never telemetry."""

    LIVE = "live"
    STALE = "stale"
    AWAY = "away"


class VesselState(msgspec.Struct, frozen=True, kw_only=True):
    """One vessel. age_s: since anything came of it, unset where nothing did. What is unset was never telemetry.

    position: estimated, [m] in the vessel's own map and [deg] of WGS 84; yaw_rad: counter-clockwise from east.
    inhibits: why it may not move. silent: processes that were heard and are not any more. unready: those that say so.
    """

    name: str
    contact: Contact
    age_s: float | None = None
    x_m: float | None = None
    y_m: float | None = None
    latitude_deg: float | None = None
    longitude_deg: float | None = None
    yaw_rad: float | None = None
    speed_mps: float | None = None
    pose_healthy: bool | None = None
    armed: bool | None = None
    stopped: bool | None = None
    changed_by: str = ""
    direction: str = ""
    reason: str = ""
    inhibits: tuple[str, ...] = ()
    thrust_left: float | None = None
    thrust_right: float | None = None
    zero_cause: str = ""
    processes: int = 0
    silent: tuple[str, ...] = ()
    unready: tuple[str, ...] = ()

    @property
    def mode(self) -> str:
        """In one word."""
        if self.stopped is None:
            return "unknown"
        return "STOPPED" if self.stopped else "armed" if self.armed else "disarmed"


TOPICS: Mapping[str, keys.Topic[Any]] = MappingProxyType(
    {
        "odometry": keys.ODOMETRY, "advisory": keys.ADVISORY, "command": keys.COMMAND,
        "operator": keys.OPERATOR_STATE, "applied": keys.THRUST_APPLIED,
    }
)  # fmt: skip


class Telemetry(msgspec.Struct, frozen=True, kw_only=True):
    """The newest message of each of `TOPICS`, None before the first. health: by process, with its age [s].

    age_s: of the newest of all. ages_s: of each, by its name in `TOPICS`; what is not there is as new as that.
    """

    age_s: float
    ages_s: Mapping[str, float] = {}
    odometry: m.Odometry | None = None
    advisory: m.Advisory | None = None
    command: m.NavCommand | None = None
    operator: m.OperatorState | None = None
    applied: m.ThrustApplied | None = None
    health: Mapping[str, tuple[m.Health, float]] = {}


def describe_vessel(name: str, telemetry: Telemetry) -> VesselState:
    """The row of a vessel. What had fallen silent before anything else was heard is not known any more."""
    if math.isinf(telemetry.age_s):
        return VesselState(name=name, contact=Contact.AWAY)
    state = VesselState(
        name=name,
        contact=Contact.LIVE if telemetry.age_s <= STALE_S else Contact.STALE,
        age_s=round(telemetry.age_s, 2),
        processes=len(telemetry.health),
        silent=tuple(sorted(who for who, (_, age_s) in telemetry.health.items() if age_s > HEALTH_STALE_S)),
        unready=tuple(sorted(who for who, (report, _) in telemetry.health.items() if not report.ready)),
    )
    is_silent = {name: telemetry.ages_s.get(name, 0.0) > telemetry.age_s + TOPICS[name].fresh_s for name in TOPICS}
    telemetry = msgspec.structs.replace(telemetry, **{name: None for name in TOPICS if is_silent[name]})
    changes: dict[str, object] = {}
    if (pose := telemetry.odometry) is not None:
        changes |= {name: getattr(pose, name) for name in ("x_m", "y_m", "latitude_deg", "longitude_deg", "yaw_rad")}
        changes |= {"speed_mps": math.hypot(pose.surge_mps, pose.sway_mps), "pose_healthy": pose.healthy}
    if (operator := telemetry.operator) is not None:
        changes |= {"armed": operator.armed, "stopped": operator.stopped, "changed_by": operator.by}
    if telemetry.advisory is not None:
        changes |= {"direction": telemetry.advisory.direction.value, "reason": telemetry.advisory.reason.value}
    if telemetry.command is not None:
        changes |= {"inhibits": tuple(each.value for each in telemetry.command.inhibits)}
    if (applied := telemetry.applied) is not None:
        changes |= {"thrust_left": applied.left, "thrust_right": applied.right, "zero_cause": applied.zero_cause.value}
    return msgspec.structs.replace(state, **changes)


def fleet_table(states: Iterable[VesselState]) -> str:
    """A line for each vessel, under a heading."""
    rows: list[tuple[str, ...]] = [HEADING, *(_row(state) for state in states)]
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    return "".join(
        "  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)).rstrip() + "\n" for row in rows
    )


def _row(state: VesselState) -> tuple[str, ...]:
    position = "-" if state.x_m is None or state.y_m is None else f"{state.x_m:.1f}, {state.y_m:.1f}"
    if state.pose_healthy is False:
        position += " (not to be trusted)"
    thrust = "-"
    if state.thrust_left is not None and state.thrust_right is not None:
        thrust = f"{state.thrust_left:+.2f} {state.thrust_right:+.2f}"
    faults = [f"{who} silent" for who in state.silent] + [f"{who} not ready" for who in state.unready]
    return (
        state.name,
        state.contact.value,
        "-" if state.age_s is None else f"{state.age_s:.1f}",
        state.mode + (f" by {state.changed_by}" if state.changed_by else ""),
        position,
        "-" if state.speed_mps is None else f"{state.speed_mps:.2f}",
        state.direction or "-",
        thrust,
        ", ".join(state.inhibits) or "-",
        ", ".join(faults) or (f"{state.processes} well" if state.processes else "-"),
    )
