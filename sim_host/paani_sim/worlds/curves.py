"""Plane curves and polygons: resampling, offsets, containment, distances. Pure numpy, metres."""

import itertools

import numpy as np
import numpy.typing as npt

from paani.arrays import F64

_CHUNK = 128  # points at once, so that they and a shore's edges stay in the processor's cache


def closed_length_m(points_m: F64) -> float:
    """Perimeter of the closed polygon `(n, 2)`."""
    return float(np.linalg.norm(np.roll(points_m, -1, axis=0) - points_m, axis=1).sum())


def open_length_m(points_m: F64) -> float:
    """Length of the open line `(n, 2)`."""
    return float(np.linalg.norm(np.diff(points_m, axis=0), axis=1).sum())


def circle(centre_m: tuple[float, float], radius_m: float, count: int) -> F64:
    """Points `(count, 2)` of a circle, counter-clockwise from east."""
    angle = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    return np.column_stack([centre_m[0] + radius_m * np.cos(angle), centre_m[1] + radius_m * np.sin(angle)])


def resample_closed(points_m: F64, count: int, start_m: float = 0.0) -> F64:
    """`count` points at equal arc length along the closed polygon, the first `start_m` along."""
    ring = np.vstack([points_m, points_m[:1]])
    arc_m = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(ring, axis=0), axis=1))])
    at_m = (start_m + np.arange(count) * arc_m[-1] / count) % arc_m[-1]
    return np.column_stack([np.interp(at_m, arc_m, ring[:, k]) for k in (0, 1)])


def sampled_legs(line_m: F64, step_m: float, *, closed: bool) -> list[F64]:
    """Each leg of the line as points at most `step_m` apart, both its ends included; 4000 points a leg at most."""
    ends_m = np.vstack([line_m, line_m[:1]]) if closed else line_m
    legs = []
    for start, end in itertools.pairwise(ends_m):
        count = min(4000, int(np.ceil(np.hypot(*(end - start)) / step_m)) + 1)
        legs.append(start + np.linspace(0.0, 1.0, max(2, count))[:, None] * (end - start))
    return legs


def point_along_closed(points_m: F64, distance_m: float) -> tuple[float, float, float]:
    """`(x_m, y_m, yaw_rad)` at `distance_m` (wrapped) along the closed polygon."""
    return _point_along(np.vstack([points_m, points_m[:1]]), distance_m % closed_length_m(points_m))


def point_along_open(points_m: F64, distance_m: float) -> tuple[float, float, float]:
    """`(x_m, y_m, yaw_rad)` at `distance_m` (held within its ends) along the open line."""
    return _point_along(points_m, min(max(distance_m, 0.0), open_length_m(points_m)))


def _point_along(line_m: F64, at_m: float) -> tuple[float, float, float]:
    steps = np.diff(line_m, axis=0)
    arc_m = np.concatenate([[0.0], np.cumsum(np.linalg.norm(steps, axis=1))])
    leg = min(int(np.searchsorted(arc_m, at_m, side="right")) - 1, len(steps) - 1)
    part = (at_m - arc_m[leg]) / (arc_m[leg + 1] - arc_m[leg])
    x_m, y_m = line_m[leg] + part * steps[leg]
    return float(x_m), float(y_m), float(np.arctan2(steps[leg, 1], steps[leg, 0]))


def normals_left(points_m: F64, *, closed: bool) -> F64:
    """Unit normals `(n, 2)` to the left of the direction of travel, central differences."""
    around = np.vstack([points_m[-1:], points_m, points_m[:1]]) if closed else points_m
    tangent = np.gradient(around, axis=0)
    tangent = tangent[1:-1] if closed else tangent
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    return np.column_stack([-tangent[:, 1], tangent[:, 0]])


def simplify_polygon(points_m: F64, within_m: float) -> F64:
    """The closed polygon without the points that lie within `within_m` of the straight line past them."""
    kept = [0]
    first = 0
    count = len(points_m)
    while first < count:
        last = first + 1
        while last < count and _is_straight(points_m, first, last + 1, within_m):
            last += 1
        if last >= count:
            break
        kept.append(last)
        first = last
    return points_m[kept]


def _is_straight(points_m: F64, first: int, last: int, within_m: float) -> bool:
    """Whether everything between two points of the closed polygon lies close to the line from one to the other."""
    between = points_m[first + 1 : last] - points_m[first]
    way = points_m[last % len(points_m)] - points_m[first]
    length_m = float(np.hypot(*way))
    if length_m == 0.0:
        return False
    off_m = np.abs(between[:, 0] * way[1] - between[:, 1] * way[0]) / length_m
    return bool(off_m.max() <= within_m)


def is_inside(polygon_m: F64, points_m: F64) -> npt.NDArray[np.bool_]:
    """Even-odd test of `(m, 2)` points against the closed polygon `(n, 2)`."""
    x, y = points_m.T
    x0, y0 = polygon_m.T
    x1, y1 = np.roll(x0, -1), np.roll(y0, -1)
    point, edge = np.nonzero((y0 > y[:, None]) != (y1 > y[:, None]))
    along_x = (x1 - x0)[edge] * (y[point] - y0[edge]) / (y1 - y0)[edge] + x0[edge]
    crossed = np.bincount(point[x[point] < along_x], minlength=len(points_m))
    result: npt.NDArray[np.bool_] = crossed % 2 == 1
    return result


def distance_to_edges_m(polygon_m: F64, points_m: F64) -> npt.NDArray[np.float64]:
    """Unsigned distance `(m,)` from each point to the nearest edge of the closed polygon."""
    x, y = polygon_m.T
    edge_x, edge_y = np.roll(x, -1) - x, np.roll(y, -1) - y
    length2 = np.maximum(edge_x * edge_x + edge_y * edge_y, 1e-12)
    best = np.empty(len(points_m))
    for first in range(0, len(points_m), _CHUNK):
        rel_x = points_m[first : first + _CHUNK, 0, None] - x
        rel_y = points_m[first : first + _CHUNK, 1, None] - y
        part = np.clip((rel_x * edge_x + rel_y * edge_y) / length2, 0.0, 1.0)
        off_x, off_y = rel_x - part * edge_x, rel_y - part * edge_y
        best[first : first + _CHUNK] = np.sqrt((off_x * off_x + off_y * off_y).min(1))
    return best


def clearance_m(polygon_m: F64, points_m: F64) -> npt.NDArray[np.float64]:
    """Signed distance `(m,)` to the shore: positive in the water, negative on land."""
    sign = np.where(is_inside(polygon_m, points_m), 1.0, -1.0)
    return sign * distance_to_edges_m(polygon_m, points_m)
