"""A route as a file gives it, and thinning one."""

from __future__ import annotations

import math

import msgspec

from paani_services.navigator.files.placing import LatLon, Spot

MAX_POINTS = 100_000  # a day of a recorder that writes once a second
MAX_NAME = 100
BLOCK = 250  # points that are thinned together: bounds the work of a line that cannot be thinned

Points = tuple[tuple[float, float], ...]


class Line(msgspec.Struct, frozen=True):
    """`repeat`: the last point leads back to the first. `origin_deg`: where metres are counted from."""

    name: str
    spots: tuple[Spot, ...]
    repeat: bool = False
    origin_deg: LatLon | None = None


def clean_name(name: str) -> str:
    """One line of printable characters."""
    return "".join(letter if letter.isprintable() else " " for letter in name).strip()[:MAX_NAME]


def fraction_digits(value: float, digits: int) -> str:
    """Fixed point with this many digits; never minus zero."""
    text = f"{value:.{digits}f}"
    return text.lstrip("-") if float(text) == 0.0 else text


def kept(points_m: Points, tolerance_m: float) -> list[int]:
    """Indices of the points that stay: no point left out lies further than the tolerance from the line that is left.

    Douglas and Peucker, Cartographica 10 (1973), in blocks of 250 points whose ends stay.
    """
    keep = {0, len(points_m) - 1}
    for first in range(0, len(points_m) - 1, BLOCK):
        last = min(first + BLOCK, len(points_m) - 1)
        keep |= {first, last}
        open_ends = [(first, last)]
        while open_ends:
            start, end = open_ends.pop()
            if end - start < 2:
                continue
            between = range(start + 1, end)
            off_m = [_off_m(points_m[number], points_m[start], points_m[end]) for number in between]
            worst = between[off_m.index(max(off_m))]
            if max(off_m) > tolerance_m:
                keep.add(worst)
                open_ends += [(start, worst), (worst, end)]
    return sorted(keep)


def _off_m(point: tuple[float, float], start: tuple[float, float], end: tuple[float, float]) -> float:
    """Distance from the piece of line."""
    along_x, along_y = end[0] - start[0], end[1] - start[1]
    length2 = along_x * along_x + along_y * along_y
    from_x, from_y = point[0] - start[0], point[1] - start[1]
    part = min(1.0, max(0.0, (from_x * along_x + from_y * along_y) / length2)) if length2 > 0.0 else 0.0
    return math.hypot(from_x - part * along_x, from_y - part * along_y)
