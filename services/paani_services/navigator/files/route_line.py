"""A route as a file gives it: its points before they are placed on the map."""

from __future__ import annotations

import msgspec

from paani_services.navigator.files.map_frame import FilePoint, LatLon

MAX_POINTS = 100_000  # of one file: a day of a recorder that writes once a second
MAX_NAME_LENGTH = 100


class RouteLine(msgspec.Struct, frozen=True):
    """`repeat`: the last point leads back to the first. `origin_deg`: where metres are counted from."""

    name: str
    points: tuple[FilePoint, ...]
    repeat: bool = False
    origin_deg: LatLon | None = None


def clean_name(name: str) -> str:
    """The name as one line of printable characters."""
    return "".join(letter if letter.isprintable() else " " for letter in name).strip()[:MAX_NAME_LENGTH]


def fixed_point_text(value: float, digits: int) -> str:
    """The number in fixed point with this many digits after the point; never minus zero."""
    text = f"{value:.{digits}f}"
    return text.lstrip("-") if float(text) == 0.0 else text
