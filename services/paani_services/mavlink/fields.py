"""Numbers as fields of MAVLink messages hold them. Pure."""

from __future__ import annotations

import math

from paani.geometry import heading_true_deg

U8_MAX, U16_MAX = 0xFF, 0xFFFF
I16_MAX, I32_MAX, U32_MAX = 0x7FFF, 0x7FFF_FFFF, 0xFFFF_FFFF


def to_int(value: float, low: int, high: int) -> int:
    """The nearest integer that the field holds."""
    return round(min(max(value, low), high))


def i16(value: float) -> int:
    """A signed field of 16 bits."""
    return to_int(value, -I16_MAX, I16_MAX)


def degrees_e7(angle_deg: float) -> int:
    """Latitude or longitude in 1e-7 degrees; longitudes beyond a half turn are turned back."""
    return to_int(math.remainder(angle_deg, 360.0) * 1e7, -1_800_000_000, 1_800_000_000)


def heading_centidegrees(yaw_rad: float) -> int:
    """Compass heading of an ENU yaw, 0 to 35999."""
    return round(heading_true_deg(yaw_rad) * 100.0) % 36_000


def integer(parameter: float) -> int | None:
    """A parameter of a command as the integer that it stands for; None for what is none, NaN among it."""
    return round(parameter) if math.isfinite(parameter) and parameter == round(parameter) else None
