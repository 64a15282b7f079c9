"""Silhouettes of things in a picture, by projection of their outlines. Pure numpy."""

from __future__ import annotations

import numpy as np

from paani.arrays import F64
from paani_sim.eye.camera import NEAR_M
from paani_sim.worlds import Actor, Obstacle
from paani_sim.worlds.footprint import CORNERS

MAX_FLOATING_BASE_M = 0.2  # a thing with a higher foot stands on something else, or bridges the water
_RING = np.arange(CORNERS)
_NEXT = (_RING + 1) % CORNERS
_EDGES = np.concatenate(
    [
        np.column_stack([_RING, _NEXT]),
        np.column_stack([_RING + CORNERS, _NEXT + CORNERS]),
        np.column_stack([_RING, _RING + CORNERS]),
    ]
)


def height_span_m(thing: Obstacle | Actor) -> tuple[float, float]:
    """Foot and top above the water [m]."""
    foot_m = thing.base_z_m if isinstance(thing, Obstacle) else 0.0
    return foot_m, foot_m + thing.height_m


def project_silhouettes(outlines_m: F64, heights_m: F64, clip_from_map: F64) -> list[F64]:
    """Points around each silhouette, `(k, 2)` normalised to the picture (not cut to it); empty where it lies behind.

    outlines_m: `(n, 8, 2)`. heights_m: foot and top, `(n, 2)`. Their convex hull is the silhouette.
    """
    count = len(outlines_m)
    points = np.ones((count, 2 * CORNERS, 4))
    points[:, :CORNERS, :2] = points[:, CORNERS:, :2] = outlines_m
    points[:, :CORNERS, 2], points[:, CORNERS:, 2] = heights_m[:, :1], heights_m[:, 1:]
    clip = points @ clip_from_map.T
    one, other = clip[:, _EDGES[:, 0]], clip[:, _EDGES[:, 1]]
    with np.errstate(divide="ignore", invalid="ignore"):
        part = (NEAR_M - one[..., 3]) / (other[..., 3] - one[..., 3])
        cut = one + part[..., None] * (other - one)  # of an edge that crosses the near plane; other values are not used
    behind_one, behind_other = one[..., 3] < NEAR_M, other[..., 3] < NEAR_M
    first = np.where(behind_one[..., None], cut, one)
    second = np.where(behind_other[..., None], cut, other)
    ends = np.concatenate([first, second], axis=1)
    is_visible = np.tile(~(behind_one & behind_other), 2)
    with np.errstate(divide="ignore", invalid="ignore"):
        across = 0.5 + 0.5 * ends[..., 0] / ends[..., 3]
        down = 0.5 - 0.5 * ends[..., 1] / ends[..., 3]
    place = np.clip(np.stack([across, down], axis=-1), -20.0, 20.0)
    return [place[i, is_visible[i]] for i in range(count)]


def bounds_in_picture(points: F64) -> tuple[F64, F64]:
    """Least and greatest corner of what the picture shows of the convex hull of points; equal where it shows nothing.

    What lies beyond one side of the picture does not stretch the bounds along another.
    """
    for axis in (0, 1):
        for inwards, side in ((1.0, 0.0), (-1.0, -1.0)):
            points = _cut(points, inwards * points[:, axis] - side)
    if not len(points):
        return np.zeros(2), np.zeros(2)
    low, high = (np.clip(each, 0.0, 1.0) for each in (points.min(axis=0), points.max(axis=0)))
    return low, high


def _cut(points: F64, inside: F64) -> F64:
    """Points with the part of the convex hull of `points` that is inside: those, and where its edges cross the line.

    inside: of each point, its distance to that line; negative beyond it.
    """
    is_beyond = inside < 0.0
    if not is_beyond.any():
        return points
    kept, beyond = points[~is_beyond, None], points[is_beyond]
    part = inside[~is_beyond, None] / (inside[~is_beyond, None] - inside[is_beyond])
    crossings = (kept + part[..., None] * (beyond - kept)).reshape(-1, 2)
    if not len(crossings):
        return kept[:, 0]
    ends = (*crossings.argmin(axis=0), *crossings.argmax(axis=0))
    return np.concatenate([kept[:, 0], crossings[list(ends)]])
