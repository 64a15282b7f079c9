"""Outlines of things from above, as they are drawn, collide and are scored. Pure numpy."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from paani.arrays import F64
from paani_sim.worlds.world import Actor, Obstacle, Pose2

CORNERS = 8
_BOX = np.array([[1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0]], np.float64)
_ANGLES = np.arange(CORNERS) * 2.0 * np.pi / CORNERS
_ROUND = np.column_stack([np.cos(_ANGLES), np.sin(_ANGLES)])


class BowShape(NamedTuple):
    """How a hull narrows, in shares of its half length and width: full to `from_x`, `at_y` at `at_x`, then `tip_y`.

    About the least such outline that holds the hull as the eye draws it, rake included.
    """

    from_x: float
    at_x: float
    at_y: float
    tip_y: float


BOWS = {
    "rowboat": BowShape(-0.16, 0.62, 0.86, 0.02),
    "dinghy": BowShape(0.42, 0.82, 0.69, 0.24),
    "kayak": BowShape(0.40, 0.84, 0.65, 0.02),
    "cruiser": BowShape(-0.04, 0.50, 0.81, 0.03),
    "sailboat": BowShape(-0.08, 0.50, 0.82, 0.02),
    "workboat": BowShape(0.02, 0.56, 1.00, 0.02),
    "barge": BowShape(0.38, 0.74, 0.79, 0.02),
    "narrowboat": BowShape(0.58, 0.82, 0.68, 0.02),
    "tug": BowShape(0.26, 0.40, 0.95, 0.43),
    "paddleboard": BowShape(0.30, 0.74, 0.78, 0.20),
    "jetski": BowShape(0.10, 0.62, 0.80, 0.10),
    "ferry": BowShape(0.56, 0.82, 0.80, 0.20),
}
# What narrows at both ends: full to the first share of the half length, the second of the half width at the tips.
TAPERED = {"eight": (0.64, 0.06), "bridge_pier": (0.74, 0.10), "island": (0.48, 0.40)}


def is_round(thing: Obstacle | Actor) -> bool:
    """An upright cylinder; everything else is as long as it is, and as wide."""
    return thing.length_m == thing.width_m


def build_outline(thing: Obstacle | Actor) -> F64:
    """Its outline about its own middle, bow along x, `(8, 2)`, convex and counter-clockwise."""
    unit = _BOX
    if is_round(thing):
        unit = _ROUND
    elif thing.look in BOWS:
        unit = _build_pointed_outline(BOWS[thing.look])
    elif thing.look in TAPERED:
        unit = build_tapered_outline(thing.look)
    return unit * [0.5 * thing.length_m, 0.5 * thing.width_m]


def is_shaped(thing: Obstacle | Actor) -> bool:
    """Whether its outline is neither a circle nor a rectangle."""
    return not is_round(thing) and (thing.look in BOWS or thing.look in TAPERED)


def place_outline(shape_m: F64, pose: Pose2) -> F64:
    """The outline `(8, 2)` in the map."""
    cos, sin = np.cos(pose.yaw_rad), np.sin(pose.yaw_rad)
    x, y = shape_m[:, 0], shape_m[:, 1]
    return np.column_stack([pose.x_m + cos * x - sin * y, pose.y_m + sin * x + cos * y])


def _build_pointed_outline(bow: BowShape) -> F64:
    return _mirrored([[1.0, bow.tip_y], [bow.at_x, bow.at_y], [bow.from_x, 1.0], [-1.0, 1.0]])


def build_tapered_outline(look: str) -> F64:
    """The outline of one of `TAPERED` in half lengths and half widths, `(8, 2)`."""
    full_to, tip_y = TAPERED[look]
    return _mirrored([[1.0, tip_y], [full_to, 1.0], [-full_to, 1.0], [-1.0, tip_y]])


def _mirrored(port: list[list[float]]) -> F64:
    corners = np.array(port)
    return np.vstack([corners, corners[::-1] * [1.0, -1.0]])


def is_apart(one: F64, other: F64, room_m: float) -> bool:
    """Whether an edge of one of two convex outlines separates them by more than this."""
    for edges in (one, other):
        leg = np.roll(edges, -1, axis=0) - edges
        outward = np.column_stack([leg[:, 1], -leg[:, 0]]) / np.maximum(np.hypot(*leg.T), 1e-9)[:, None]
        far, own = (other if edges is one else one) @ outward.T, edges @ outward.T
        if (far.min(axis=0) - own.max(axis=0) > room_m).any():
            return True
    return False
