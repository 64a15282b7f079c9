"""Weirs and the piers of bridges as meshes: long side along x, centred on the origin, water at z = 0. Pure numpy."""

import itertools

import numpy as np

from paani_sim.eye.mesh import ROCK, STONE, WOOD, Mesh, Rgb, box, ellipsoid, loft, merge, placed, rod
from paani_sim.worlds.footprint import build_tapered_outline

CONCRETE: Rgb = (0.56, 0.55, 0.51)
WEED: Rgb = (0.20, 0.24, 0.14)
FOAM: Rgb = (0.88, 0.90, 0.89)
STEEL: Rgb = (0.32, 0.34, 0.36)
POST_EVERY_M = 5.5


def weir(length: float, width: float, height: float, variant: int) -> Mesh:
    """A low sill with posts; beyond it, at +y, the water breaks white."""
    parts = [
        placed(box((length, 0.5 * width, height + 0.7), CONCRETE, ROCK), (0.0, -0.2 * width, 0.5 * (height - 0.7))),
        placed(box((length, 0.52 * width, 0.22), WEED, ROCK), (0.0, -0.2 * width, 0.04)),
    ]
    rng = np.random.default_rng(variant)
    for x in np.arange(-0.48, 0.48, 0.35 / length).tolist():
        size = (float(rng.uniform(0.25, 0.6)), float(rng.uniform(0.15, 0.3)), float(rng.uniform(0.05, 0.16)))
        at = (x * length, float(rng.uniform(0.15, 0.45)) * width, 0.02)
        parts.append(placed(ellipsoid(size, FOAM, 6), at))
    posts = max(2, round(length / POST_EVERY_M))
    for number, x in enumerate(np.linspace(-0.5 * length + 0.3, 0.5 * length - 0.3, posts).tolist()):
        parts.append(rod((x, -0.2 * width, -0.3), (x, -0.2 * width, height + 1.5), 0.07, STEEL))
        if number % 2:
            board = box((0.9, 0.05, 0.5), (0.92, 0.90, 0.86), WOOD)
            bar = box((0.9, 0.06, 0.14), (0.80, 0.08, 0.07))
            parts += [placed(part, (x, -0.2 * width - 0.06, height + 1.25)) for part in (board, bar)]
    return merge(*parts)


def bridge_pier(length: float, width: float, height: float, variant: int) -> Mesh:
    """A stone pier with cutwaters at both ends, and the weed at its foot."""
    around = build_tapered_outline("bridge_pier") * [0.5 * length, 0.5 * width]
    plan = np.vstack([around, around[:1]])
    tone = 1.0 - 0.1 * (variant % 3)
    stone: Rgb = (0.58 * tone, 0.54 * tone, 0.47 * tone)
    faces = []
    for one, other in itertools.pairwise(plan):
        for low, high, rgb in ((-0.9, 0.18, WEED), (0.18, height, stone)):
            corners = [[(*one, low), (*other, low)], [(*one, high), (*other, high)]]
            faces.append(loft(np.array(corners)[:, ::-1], rgb, STONE))
    cap = placed(box((0.78 * length, 1.12 * width, 0.25), stone, ROCK), (0.0, 0.0, height - 0.12))
    return merge(*faces, cap)
