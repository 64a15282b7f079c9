"""Drifting logs, swimming dogs, birds and islands: facing +x, the water at z = 0. Pure numpy."""

import itertools

import numpy as np

from paani_sim.eye.mesh import LAND, Mesh, Rgb, ellipsoid, loft, merge, placed, rod

COATS: tuple[Rgb, ...] = ((0.16, 0.11, 0.08), (0.62, 0.46, 0.26), (0.12, 0.12, 0.13), (0.80, 0.76, 0.70))
SNOW: Rgb = (0.93, 0.93, 0.91)
BILL: Rgb = (0.90, 0.42, 0.08)
DARK: Rgb = (0.06, 0.06, 0.06)
BARK: tuple[Rgb, ...] = ((0.30, 0.22, 0.15), (0.36, 0.30, 0.23), (0.24, 0.20, 0.15))
ISLAND_TOP_M = 0.9


def log(length: float, width: float, height: float, variant: int) -> Mesh:
    """A trunk that floats with a third of it out of the water, and the stub of a branch."""
    rgb, radius = BARK[variant % len(BARK)], 0.5 * width
    z = height - radius
    sawn = (min(1.0, rgb[0] * 2.1), rgb[1] * 2.0, rgb[2] * 1.7)
    parts = [
        rod((-0.5 * length, 0.0, z), (0.5 * length, 0.0, z), radius, rgb, 11, 0.78 * radius),
        rod((-0.5 * length - 0.01, 0.0, z), (-0.5 * length, 0.0, z), 0.94 * radius, sawn, 9),
    ]
    if variant % 2:
        parts.append(rod((0.12 * length, 0.0, z), (0.30 * length, 0.3 * width, z + 1.3 * width), 0.05, rgb, 6, 0.02))
    return merge(*parts)


def dog(length: float, width: float, height: float, variant: int) -> Mesh:
    """A dog that swims: head and back out of the water."""
    coat = COATS[variant % len(COATS)]
    ear = (0.7 * coat[0], 0.7 * coat[1], 0.7 * coat[2])
    reach, head_z = 0.5 * length, 0.58 * height
    parts = [
        placed(ellipsoid((0.62 * reach, 0.42 * width, 0.22 * height), coat), (-0.28 * reach, 0.0, -0.02)),
        placed(ellipsoid((0.26 * reach, 0.26 * width, 0.34 * height), coat), (0.42 * reach, 0.0, 0.4 * head_z)),
        placed(ellipsoid((0.24 * reach, 0.28 * width, 0.30 * height), coat, 10), (0.62 * reach, 0.0, head_z)),
        placed(ellipsoid((0.20 * reach, 0.15 * width, 0.15 * height), coat), (0.86 * reach, 0.0, 0.86 * head_z)),
        placed(ellipsoid((0.04 * reach, 0.06 * width, 0.05 * height), DARK), (1.04 * reach, 0.0, 0.92 * head_z)),
    ]
    for side in (1.0, -1.0):
        flap = ellipsoid((0.10 * reach, 0.05 * width, 0.22 * height), ear)
        parts.append(placed(flap, (0.56 * reach, side * 0.30 * width, 0.95 * head_z)))
        parts.append(placed(ellipsoid((0.02, 0.015, 0.015), DARK), (0.80 * reach, side * 0.14 * width, 1.1 * head_z)))
    return merge(*parts)


def swan(length: float, width: float, height: float, variant: int) -> Mesh:
    """A swan, white, or grey in its first year."""
    rgb: Rgb = (0.58, 0.54, 0.48) if variant % 5 == 4 else SNOW
    x, neck = 0.5 * length, [(0.62, 0.20), (0.80, 0.42), (0.70, 0.66), (0.74, 0.88)]
    parts = [
        placed(ellipsoid((0.80 * x, 0.5 * width, 0.26 * height), rgb, 12), (-0.14 * x, 0.0, 0.14 * height)),
        placed(ellipsoid((0.52 * x, 0.40 * width, 0.20 * height), rgb, 10), (-0.40 * x, 0.0, 0.30 * height)),
        placed(ellipsoid((0.22 * x, 0.16 * width, 0.06 * height), rgb), (-0.90 * x, 0.0, 0.36 * height)),
    ]
    points = [(share * x, 0.0, up * height) for share, up in neck]
    parts += [rod(one, other, 0.055, rgb, 8, 0.048) for one, other in itertools.pairwise(points)]
    parts += [placed(ellipsoid((0.055, 0.055, 0.055), rgb), point) for point in points]
    parts += [
        placed(ellipsoid((0.10, 0.06, 0.065), rgb), (0.80 * x, 0.0, 0.92 * height)),
        rod((0.90 * x, 0.0, 0.91 * height), (1.0 * x + 0.06, 0.0, 0.86 * height), 0.032, BILL, 6, 0.016),
        placed(ellipsoid((0.03, 0.03, 0.03), DARK), (0.92 * x, 0.0, 0.94 * height)),
    ]
    return merge(*parts)


def duck(length: float, width: float, height: float, variant: int) -> Mesh:
    """A mallard: drakes have a green head."""
    drake = variant % 2 == 0
    body: Rgb = (0.62, 0.60, 0.57) if drake else (0.45, 0.34, 0.22)
    head: Rgb = (0.05, 0.28, 0.16) if drake else (0.40, 0.30, 0.20)
    x, tail = 0.5 * length, DARK if drake else body
    return merge(
        placed(ellipsoid((0.84 * x, 0.5 * width, 0.42 * height), body, 10), (-0.1 * x, 0.0, 0.16 * height)),
        placed(ellipsoid((0.30 * x, 0.36 * width, 0.34 * height), (0.30, 0.16, 0.10)), (0.50 * x, 0.0, 0.26 * height)),
        placed(ellipsoid((0.22 * x, 0.12 * width, 0.12 * height), tail), (-0.9 * x, 0, 0.4 * height)),
        rod((0.52 * x, 0.0, 0.4 * height), (0.62 * x, 0.0, 0.8 * height), 0.04, head, 7),
        placed(ellipsoid((0.24 * x, 0.24 * width, 0.20 * height), head, 10), (0.66 * x, 0.0, 0.82 * height)),
        placed(ellipsoid((0.14 * x, 0.10 * width, 0.05 * height), (0.85, 0.68, 0.16)), (0.95 * x, 0.0, 0.76 * height)),
    )


def island(length: float, width: float, height: float, variant: int) -> Mesh:
    """The ground of an island: mud at its edge, grass above. Its plants come with the land's."""
    turn = np.linspace(0.0, 2.0 * np.pi, 49)
    waver = 1.0 - 0.05 * (1.0 + np.sin(3.0 * turn + variant) * np.sin(5.0 * turn + 2.0 * variant))
    rows, colours = [], []
    for share, z_m, rgb in _ISLAND_RINGS:
        ring = np.column_stack([np.cos(turn), np.sin(turn)]) * (share * waver)[:, None]
        rows.append(np.column_stack([ring * [0.5 * length, 0.5 * width], np.full(49, z_m)]))
        colours.append(np.broadcast_to(np.array(rgb), (49, 3)))
    return loft(np.stack(rows), np.stack(colours), LAND)


_ISLAND_RINGS = (
    (1.04, -0.5, (0.26, 0.22, 0.16)),
    (1.0, 0.02, (0.26, 0.22, 0.16)),
    (0.96, 0.22, (0.36, 0.31, 0.23)),
    (0.88, 0.48, (0.34, 0.37, 0.19)),
    (0.66, 0.72, (0.36, 0.40, 0.20)),
    (0.30, 0.86, (0.33, 0.38, 0.18)),
    (0.02, ISLAND_TOP_M, (0.33, 0.38, 0.18)),
)


def island_height_m(length: float, width: float, x: float, y: float) -> float:
    """Height of an island's ground at a place in its own frame."""
    share = float(np.hypot(x / (0.5 * length), y / (0.5 * width)))
    shares, heights = ([ring[k] for ring in reversed(_ISLAND_RINGS)] for k in (0, 1))
    return float(np.interp(share, shares, heights))
