"""Triangles sorted by where they are, so that a picture draws only what lies ahead, near to far. Pure."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

CELL_M = 48.0

F64 = npt.NDArray[np.float64]
U32 = npt.NDArray[np.uint32]


@dataclass(frozen=True, eq=False)
class Chunks:
    """`order` holds the indices chunk by chunk; chunk k is `count[k]` of them from `first[k]`."""

    order: U32
    first: npt.NDArray[np.int64]
    count: npt.NDArray[np.int64]
    centre_m: F64
    radius_m: F64


def make_chunks(place_m: F64, order: U32, reach_m: F64) -> Chunks:
    """Sort triangles into square cells; vertex k at `place_m[k]` `(n, 2)` draws up to `reach_m[k]` around."""
    if len(order) == 0:
        none = np.zeros(0, np.int64)
        return Chunks(order, none, none, np.zeros((0, 2)), np.zeros(0))
    triangles = order.reshape(-1, 3)
    middle = place_m[triangles].mean(axis=1)
    cell = np.floor(middle / CELL_M).astype(np.int64)
    key = cell[:, 0] * 100_003 + cell[:, 1]
    by_cell = np.argsort(key, kind="stable")
    first = np.flatnonzero(np.diff(key[by_cell], prepend=key[by_cell][0] - 1))
    count = np.diff(np.append(first, len(key)))
    corners = triangles[by_cell]
    centre = np.stack([np.add.reduceat(middle[by_cell, k], first) / count for k in (0, 1)], axis=1)
    home = np.repeat(centre, count, axis=0)[:, None]
    spread = np.linalg.norm(place_m[corners] - home, axis=2) + reach_m[corners]
    radius = np.maximum.reduceat(spread.max(axis=1), first)
    return Chunks(corners.reshape(-1).astype(np.uint32), 3 * first, 3 * count, centre, radius)


def visible(
    chunks: Chunks, eye_m: F64, heading_rad: float, half_angle_rad: float, within_m: float = np.inf
) -> npt.NDArray[np.int64]:
    """Numbers of the chunks that reach into the wedge `half_angle_rad` either side and nearer, nearest first."""
    offset = chunks.centre_m - eye_m[:2]
    inside = np.hypot(offset[:, 0], offset[:, 1]) < chunks.radius_m + within_m
    for side in (1.0, -1.0):
        edge = heading_rad + side * half_angle_rad
        inward = side * np.array([np.sin(edge), -np.cos(edge)])
        inside &= offset @ inward > -chunks.radius_m
    found = np.flatnonzero(inside)
    near = np.linalg.norm(offset[found], axis=1) - chunks.radius_m[found]
    return np.asarray(found[np.argsort(near, kind="stable")])
