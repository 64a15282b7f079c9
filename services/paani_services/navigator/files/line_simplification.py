"""Simplification of a line of points after Douglas and Peucker, Cartographica 10 (1973).

The line is simplified in blocks of `BLOCK` points whose ends are kept, so that a line that cannot be simplified costs
bounded work.
"""

from __future__ import annotations

import math

BLOCK = 250  # points simplified together; the work of a block grows with the square of it at worst

Points = tuple[tuple[float, float], ...]


def simplify_line(points_m: Points, tolerance_m: float) -> list[int]:
    """Indices of the points to keep: no other point lies further than the tolerance from the line through them."""
    keep = {0, len(points_m) - 1}
    for first in range(0, len(points_m) - 1, BLOCK):
        last = min(first + BLOCK, len(points_m) - 1)
        keep |= {first, last}
        pieces = [(first, last)]
        while pieces:
            start, end = pieces.pop()
            if end - start < 2:
                continue
            between = range(start + 1, end)
            distances_m = [_distance_to_piece_m(points_m[number], points_m[start], points_m[end]) for number in between]
            farthest = between[distances_m.index(max(distances_m))]
            if max(distances_m) > tolerance_m:
                keep.add(farthest)
                pieces += [(start, farthest), (farthest, end)]
    return sorted(keep)


def _distance_to_piece_m(point: tuple[float, float], start: tuple[float, float], end: tuple[float, float]) -> float:
    """Distance from the straight piece of line, ends included."""
    along_x, along_y = end[0] - start[0], end[1] - start[1]
    length2 = along_x * along_x + along_y * along_y
    from_x, from_y = point[0] - start[0], point[1] - start[1]
    fraction = min(1.0, max(0.0, (from_x * along_x + from_y * along_y) / length2)) if length2 > 0.0 else 0.0
    return math.hypot(from_x - fraction * along_x, from_y - fraction * along_y)
