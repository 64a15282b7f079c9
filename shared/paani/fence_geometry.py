"""Where a boat may be: plane geometry of a fence in the map frame. Pure.

A point is allowed if it lies inside at least one area that keeps in, where there are any, and inside none that keeps
out, whose edge is not allowed either.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

from paani import portable
from paani.messages import FenceArea, Keep, Waypoint

PROBE_OFFSET_M = 0.01  # distance from an edge at which its sides are probed [m]

Point = tuple[float, float]  # east and north in the map [m]
Fence = tuple[FenceArea, ...]


class BorderWords(NamedTuple):
    """What a place beyond the border is said to be, what a leg does there, and the border's name."""

    beyond: str
    crosses: str
    border: str


FENCE_WORDS = BorderWords("is outside the fence", "leaves the fence", "the fence")
LAND_WORDS = BorderWords("is on land", "crosses land", "land")


def is_allowed(fence: Fence, at_m: Point) -> bool:
    """Whether a point lies inside an area that keeps in, if there is one, and in none that keeps out."""
    inner = [area for area in fence if area.keep is Keep.IN]
    if inner and not any(contains(area, at_m) for area in inner):
        return False
    return not any(contains(area, at_m) or _on_edge(area, at_m) for area in fence if area.keep is Keep.OUT)


def contains(area: FenceArea, at_m: Point) -> bool:
    """Whether the area contains the point: a ray to the east crosses its edges an odd number of times."""
    x_m, y_m = at_m
    inside = False
    for (x1, y1), (x2, y2) in edges(area):
        if (y1 > y_m) != (y2 > y_m) and x_m < (x2 - x1) * (y_m - y1) / (y2 - y1) + x1:
            inside = not inside
    return inside


def edges(area: FenceArea) -> Iterator[tuple[Point, Point]]:
    """The area's edges, from each corner to the next, beginning with the one that closes it."""
    last = area.corners[-1]
    for corner in area.corners:
        yield (last.x_m, last.y_m), (corner.x_m, corner.y_m)
        last = corner


def distance_to_edge_m(fence: Fence, at_m: Point) -> float:
    """Distance to the nearest edge of any area; infinite without a fence."""
    return min(
        (math.dist(at_m, _nearest(at_m, *edge)) for area in fence for edge in edges(area)),
        default=math.inf,
    )


def allowed_distance_m(fence: Fence, from_m: Point, to_m: Point) -> float:
    """Distance along the straight line up to which everything is allowed; infinite if all of it is."""
    length_m = math.dist(from_m, to_m)
    if not is_allowed(fence, from_m):
        return 0.0
    exit_part = _exit_part(fence, from_m, to_m)
    if exit_part is not None:
        return exit_part * length_m
    return math.inf if is_allowed(fence, to_m) else length_m


def return_bearing_rad(fence: Fence, at_m: Point) -> float | None:
    """Direction of the nearest allowed point from one that is not; None where there is none."""
    found = sorted(
        (_nearest(at_m, *edge) for area in fence for edge in edges(area)), key=lambda point: math.dist(at_m, point)
    )
    for x_m, y_m in found:
        rad = portable.atan2(y_m - at_m[1], x_m - at_m[0])
        if is_allowed(fence, (x_m + PROBE_OFFSET_M * portable.cos(rad), y_m + PROBE_OFFSET_M * portable.sin(rad))):
            return rad
    return None


def find_route_violation(
    fence: Fence,
    waypoints: tuple[Waypoint, ...],
    margin_m: float,
    *,
    repeat: bool = False,
    words: BorderWords = FENCE_WORDS,
) -> tuple[int, str] | None:
    """The first waypoint that is not allowed, or whose leg to the next is not or comes nearer than the margin.

    Returned are its number and what is wrong with it; None for a route within the fence.
    """
    points = [(waypoint.x_m, waypoint.y_m) for waypoint in waypoints]
    for number, point in enumerate(points):
        if not is_allowed(fence, point):
            return number, words.beyond
        if not _is_clear(fence, point, point, margin_m):
            return number, f"is nearer than {margin_m} m to {words.border}"
    for number, (start, end) in enumerate(pairwise((*points, *points[:1]) if repeat else points)):
        if _exit_part(fence, start, end) is not None:  # both ends are allowed
            return number, f"the leg to the next {words.crosses}"
        if not _is_clear(fence, start, end, margin_m):
            return number, f"the leg to the next comes nearer than {margin_m} m to {words.border}"
    return None


def _exit_part(fence: Fence, from_m: Point, to_m: Point) -> float | None:
    """The part of the way after which something between its ends is not allowed; None where there is nothing."""
    cuts = sorted(cut for area in fence for edge in edges(area) for cut in _crossings(from_m, to_m, *edge))
    for cut, beyond in pairwise((0.0, *cuts, 1.0)):
        if not is_allowed(fence, _interpolate(from_m, to_m, 0.5 * (cut + beyond))):
            return cut
    return None


def do_segments_meet(one: tuple[Point, Point], other: tuple[Point, Point]) -> bool:
    """Whether two line segments touch or cross."""
    return _may_be_within(one, other, 0.0) and _segment_distance_m(one, other) == 0.0


def _nearest(at_m: Point, start: Point, end: Point) -> Point:
    """The point of the edge nearest to `at_m`."""
    along_x, along_y = end[0] - start[0], end[1] - start[1]
    length2 = along_x * along_x + along_y * along_y
    if length2 == 0.0:
        return start
    part = ((at_m[0] - start[0]) * along_x + (at_m[1] - start[1]) * along_y) / length2
    return _interpolate(start, end, min(1.0, max(0.0, part)))


def _is_clear(fence: Fence, start: Point, end: Point, margin_m: float) -> bool:
    """Whether the segment keeps the margin to every edge, except for edges between two areas that keep in."""
    way = (start, end)
    return not any(
        _may_be_within(way, edge, margin_m) and _segment_distance_m(way, edge) < margin_m and _is_border(fence, edge)
        for area in fence
        for edge in edges(area)
    )


def _is_border(fence: Fence, edge: tuple[Point, Point]) -> bool:
    """Whether one side of the edge is not allowed somewhere along it: probed at its middle and near its ends."""
    (x1, y1), (x2, y2) = edge
    length_m = math.dist(*edge)
    left = (-(y2 - y1) / length_m * PROBE_OFFSET_M, (x2 - x1) / length_m * PROBE_OFFSET_M)
    middles = (_interpolate(*edge, part) for part in (0.01, 0.25, 0.5, 0.75, 0.99))
    return not all(
        is_allowed(fence, (x_m + side * left[0], y_m + side * left[1])) for x_m, y_m in middles for side in (-1.0, 1.0)
    )


def _may_be_within(one: tuple[Point, Point], other: tuple[Point, Point], within_m: float) -> bool:
    """Whether the bounding boxes of two segments are that near: this settles most pairs."""
    ((x1, y1), (x2, y2)), ((x3, y3), (x4, y4)) = one, other
    return (
        min(x1, x2) - within_m <= max(x3, x4)
        and min(x3, x4) - within_m <= max(x1, x2)
        and min(y1, y2) - within_m <= max(y3, y4)
        and min(y3, y4) - within_m <= max(y1, y2)
    )


def _segment_distance_m(one: tuple[Point, Point], other: tuple[Point, Point]) -> float:
    """Distance between two line segments; 0 where they meet."""
    if any(True for _ in _crossings(*one, *other)):
        return 0.0
    ends = [(point, other) for point in one] + [(point, one) for point in other]
    return min(math.dist(point, _nearest(point, *edge)) for point, edge in ends)


def _on_edge(area: FenceArea, at_m: Point) -> bool:
    """Whether the point lies on an edge of the area."""
    return any(_nearest(at_m, *edge) == at_m for edge in edges(area))


def _interpolate(start: Point, end: Point, part: float) -> Point:
    """The point at this fraction of the way from start to end."""
    return start[0] + part * (end[0] - start[0]), start[1] + part * (end[1] - start[1])


def _crossings(from_m: Point, to_m: Point, start: Point, end: Point) -> Iterator[float]:
    """Fractions of the way, from 0 to 1, at which it meets the edge; none where they are parallel."""
    way_x, way_y = to_m[0] - from_m[0], to_m[1] - from_m[1]
    edge_x, edge_y = end[0] - start[0], end[1] - start[1]
    to_x, to_y = start[0] - from_m[0], start[1] - from_m[1]
    cross = way_x * edge_y - way_y * edge_x
    if cross == 0.0:
        return
    part, along = (to_x * edge_y - to_y * edge_x) / cross, (to_x * way_y - to_y * way_x) / cross
    if 0.0 <= part <= 1.0 and -1e-9 <= along <= 1.0 + 1e-9:
        yield part
