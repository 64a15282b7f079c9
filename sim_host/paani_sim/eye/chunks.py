"""Triangles in square cells of the map, so that only visible cells are drawn, nearest first. Pure."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from paani.arrays import F64, U32

CELL_M = 32.0


@dataclass(frozen=True, eq=False)
class Chunks:
    """`order` holds the indices chunk by chunk; chunk k is `count[k]` of them from `first[k]`.

    All it draws is within the box `middle_m[k]` +/- `half_m[k]`, both `(n, 3)`.
    """

    order: U32
    first: npt.NDArray[np.int64]
    count: npt.NDArray[np.int64]
    middle_m: F64
    half_m: F64


def make_chunks(place_m: F64, order: U32, reach_m: F64) -> Chunks:
    """Sort triangles into square cells; vertex k at `place_m[k]` `(n, 3)` draws up to `reach_m[k]` `(n, 3)` around."""
    if len(order) == 0:
        none = np.zeros(0, np.int64)
        return Chunks(order, none, none, np.zeros((0, 3)), np.zeros((0, 3)))
    triangles = order.reshape(-1, 3)
    cell = np.floor(place_m[triangles, :2].mean(axis=1) / CELL_M).astype(np.int64)
    key = cell[:, 0] * 100_003 + cell[:, 1]
    by_cell = np.argsort(key, kind="stable")
    first = np.flatnonzero(np.diff(key[by_cell], prepend=key[by_cell][0] - 1))
    count = np.diff(np.append(first, len(key)))
    corners = triangles[by_cell]
    low = np.minimum.reduceat((place_m - reach_m)[corners].min(axis=1), first)
    high = np.maximum.reduceat((place_m + reach_m)[corners].max(axis=1), first)
    return Chunks(corners.reshape(-1).astype(np.uint32), 3 * first, 3 * count, 0.5 * (low + high), 0.5 * (high - low))


def is_in_view(middle_m: F64, half_m: F64, clip_from_map: F64) -> npt.NDArray[np.bool_]:
    """Whether any of a box `middle_m` +/- `half_m` `(n, 3)` can be inside the four sides of the picture."""
    inside = np.ones(len(middle_m), bool)
    for axis in (0, 1):
        for side in (1.0, -1.0):
            plane = clip_from_map[3] + side * clip_from_map[axis]
            inside &= middle_m @ plane[:3] + half_m @ np.abs(plane[:3]) > -plane[3]
    return inside


def find_visible(chunks: Chunks, clip_from_map: F64, eye_m: F64, within_m: float = np.inf) -> npt.NDArray[np.int64]:
    """Numbers of the chunks that can be in the picture and are nearer along the ground, nearest first."""
    away = np.maximum(np.abs(chunks.middle_m[:, :2] - eye_m[:2]) - chunks.half_m[:, :2], 0.0)
    range_m = np.hypot(away[:, 0], away[:, 1])
    found = np.flatnonzero(is_in_view(chunks.middle_m, chunks.half_m, clip_from_map) & (range_m < within_m))
    return np.asarray(found[np.argsort(range_m[found], kind="stable")])
