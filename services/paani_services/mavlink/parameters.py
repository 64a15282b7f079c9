"""Parameters as ground stations read them. Pure. None is written: the page tries and promotes them."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from paani.config import AdvisorConfig
from paani.config.tuning import TUNABLE, setting_text
from paani_services.mavlink.codec import SYSTEM, dialect
from paani_services.mavlink.snapshot import Snapshot

NAME_BYTES = 16
REAL, INTEGER = dialect.MAV_PARAM_TYPE_REAL32, dialect.MAV_PARAM_TYPE_INT32
NOT_IN_LIST = 0xFFFF  # index of a value that was asked for by name
MAX_INTEGER = 1 << 24  # a float holds each integer up to it


class Parameter(NamedTuple):
    """Name of at most 16 bytes, value, and type."""

    name: str
    value: float
    kind: int


def tunable_name(path: str) -> str:
    """`advisor.policy.center_block_risk` as `POL_CEN_BLO_RIS`: three letters of each word."""
    words = path.removeprefix("advisor.").replace(".", "_").split("_")
    return "_".join(word[:3] for word in words)[:NAME_BYTES].upper()


def parameters_of(snapshot: Snapshot, cruise_mps: float, advisor: AdvisorConfig) -> tuple[Parameter, ...]:
    """All of them in the order of their names, as they are now.

    Those of the policy are what the advisor says is in force; while it is silent, what it was started with.
    """
    changes = snapshot.shadow.active_changes if snapshot.shadow is not None else ()
    in_force = {change.path: change.value for change in changes}
    found = [
        Parameter("CRUISE_SPEED", cruise_mps, REAL),
        Parameter("SYSID_THISMAV", SYSTEM, INTEGER),
        Parameter("FENCE_ENABLE", bool(snapshot.fence), INTEGER),
    ]
    for path in TUNABLE:
        value = number_of(in_force.get(path, setting_text(advisor, path)))
        if value is not None:
            found.append(Parameter(tunable_name(path), *value))
    return tuple(sorted(found))


def number_of(text: str) -> tuple[float, int] | None:
    """Value and type of a setting's text; None for what is no number."""
    if text in {"true", "false"}:
        return float(text == "true"), INTEGER
    try:
        value = float(text)
    except ValueError:
        return None
    if not math.isfinite(value):
        return None
    is_integer = text.lstrip("+-").isdigit() and abs(value) <= MAX_INTEGER
    return value, INTEGER if is_integer else REAL


def param_value(parameters: tuple[Parameter, ...], index: int, *, by_name: bool = False) -> Any:
    """One parameter; integers are carried as the float of the same value, as ArduPilot does."""
    name, value, kind = parameters[index]
    return dialect.MAVLink_param_value_message(
        name.encode("ascii"), float(value), kind, len(parameters), NOT_IN_LIST if by_name else index
    )


def find(parameters: tuple[Parameter, ...], name: str) -> int | None:
    """The index of a name."""
    return next((index for index, each in enumerate(parameters) if each.name == name), None)
