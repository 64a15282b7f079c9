"""Parameters as ground stations read and write them. Pure."""

from __future__ import annotations

import math
import struct
from typing import Any, NamedTuple

from paani.config import AdvisorConfig
from paani.config.tuning import TUNABLE, setting_text
from paani_services.mavlink.codec import SYSTEM, dialect
from paani_services.mavlink.snapshot import Snapshot
from paani_services.mavlink.station import Source

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
        Parameter("RALLY_TOTAL", len(snapshot.rally), INTEGER),
        Parameter("RALLY_INCL_HOME", True, INTEGER),
        Parameter("RALLY_LIMIT_KM", 0.0, REAL),
    ]
    for path in TUNABLE:
        configured = setting_text(advisor, path)
        present, value = number_of(configured), number_of(in_force.get(path, configured))
        if present is not None and value is not None:
            found.append(Parameter(tunable_name(path), value[0], present[1]))
    return tuple(sorted(found))


def path_of(name: str) -> str | None:
    """The tunable setting that has this name; None for what is not tunable."""
    return next((path for path in TUNABLE if tunable_name(path) == name), None)


def written_text(value: float, path: str, advisor: AdvisorConfig) -> str | None:
    """What a station writes to a tunable setting, as text of the kind that it has; None where it cannot be one.

    A value comes as the float32 that is nearest to what was typed: the shortest number with that float32 is meant.
    """
    configured = setting_text(advisor, path)
    if not math.isfinite(value):
        return None
    if configured in {"true", "false"}:
        return {0.0: "false", 1.0: "true"}.get(value)
    if (number := number_of(configured)) is not None and number[1] == INTEGER:
        return str(round(value)) if value == round(value) and abs(value) <= MAX_INTEGER else None
    shortest = (float(f"{value:.{digits}g}") for digits in range(6, 10))
    return repr(next((each for each in shortest if _is_same_float32(each, value)), value))


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


def is_in_force(parameters: tuple[Parameter, ...], index: int, value: float) -> bool:
    """Whether a station that writes this value would change nothing."""
    return _is_same_float32(parameters[index].value, value)


def param_error(name: str, target: Source, error: int) -> Any:
    """Why a parameter was not read or written; stations that do not know this message go by the value."""
    return dialect.MAVLink_param_error_message(*target, name.encode("ascii", "replace")[:NAME_BYTES], -1, error)


def find(parameters: tuple[Parameter, ...], name: str) -> int | None:
    """The index of a name."""
    return next((index for index, each in enumerate(parameters) if each.name == name), None)


def _is_same_float32(one: float, other: float) -> bool:
    """Whether both are the same number to a station, which has 32 bits for it."""
    try:
        return struct.pack("<f", one) == struct.pack("<f", other)
    except OverflowError:
        return False
