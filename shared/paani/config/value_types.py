"""What a field may hold, in words: its kind and its range."""

from __future__ import annotations

from typing import Any

import msgspec
from msgspec import inspect as types

UNBOUNDED = 1e9  # limits this large only keep infinity out

UNITS = {
    "mps2": "m/s²", "radps2": "rad/s²", "radps": "rad/s", "mps": "m/s", "mmph": "mm/h", "per_s": "1/s", "per_m": "1/m",
    "rad": "rad", "deg": "°", "hz": "Hz", "frac": "fraction", "mib": "MiB", "px": "px", "nm": "N m",
    "ms": "ms", "us": "µs", "kg": "kg", "m": "m", "s": "s", "n": "N", "h": "h",
}  # fmt: skip


def unit_of(name: str) -> str:
    """The unit that the name's suffix states, or a dash."""
    for suffix, unit in UNITS.items():
        if name.endswith(f"_{suffix}"):
            return unit
    return "-"


def kind_of(info: types.Type) -> str:
    """The kind of value, for a reader who does not know Python."""
    match info:
        case types.BoolType():
            return "yes or no"
        case types.IntType():
            return "whole number"
        case types.FloatType():
            return "number"
        case types.StrType():
            return "text"
        case types.BytesType():
            return "bytes (base64)"
        case types.LiteralType():
            return "one of " + ", ".join(f"`{value}`" for value in info.values)
        case types.EnumType():
            return info.cls.__name__
        case types.StructType():
            return info.cls.__name__
        case types.TupleType():
            return f"{len(info.item_types)} x {kind_of(info.item_types[0])}"
        case types.VarTupleType():
            return f"list of {kind_of(info.item_type)}"
        case types.UnionType():
            return (
                " or ".join(kind_of(part) for part in info.types if not isinstance(part, types.NoneType)) + ", or unset"
            )
    raise ValueError(f"no words for {info}")


def range_of(info: types.Type) -> str:
    """The limits of the value, or a dash."""
    match info:
        case types.IntType() | types.FloatType():
            return _limits(info)
        case types.StrType():
            parts = [f"`{info.pattern}`"] if info.pattern else []
            parts += [f"at most {info.max_length} characters"] if info.max_length else []
            return ", ".join(parts) or "-"
        case types.BytesType():
            return f"at most {info.max_length} bytes" if info.max_length else "-"
        case types.TupleType():
            return " / ".join(dict.fromkeys(range_of(item) for item in info.item_types))
        case types.VarTupleType():
            return range_of(info.item_type)
        case types.UnionType():
            return next(range_of(part) for part in info.types if not isinstance(part, types.NoneType))
    return "-"


def text_of(value: Any) -> str:
    """A default as it is written in a settings file."""
    if isinstance(value, float) and value >= UNBOUNDED:
        return f"{value:.0e}"
    if isinstance(value, float):
        return f"{value:.6g}" if value != int(value) else str(value)
    return "unset" if value is None else msgspec.json.encode(value).decode()


def _limits(info: types.IntType | types.FloatType) -> str:
    low = f"> {info.gt:g}" if info.gt is not None else None if info.ge is None else f"{info.ge:g}"
    high = None if info.le is None or info.le >= UNBOUNDED else f"{info.le:g}"
    if low is None or (info.ge is not None and info.ge <= -UNBOUNDED):
        return "-" if high is None else f"up to {high}"
    if high is None:
        return low if low.startswith(">") else f"{low} or more"
    return f"{low} to {high}"
