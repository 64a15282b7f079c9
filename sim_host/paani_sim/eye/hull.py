"""A boat's hull as a mesh, and the colours of boats. Pure numpy."""

import numpy as np

from paani_sim.eye.mesh import Mesh, Rgb, loft, merge

WHITE: Rgb = (0.93, 0.93, 0.90)
DARK: Rgb = (0.10, 0.11, 0.12)
HULLS: tuple[Rgb, ...] = (
    WHITE,
    (0.13, 0.22, 0.40),
    (0.70, 0.13, 0.12),
    (0.88, 0.86, 0.78),
    (0.12, 0.33, 0.24),
    (0.95, 0.72, 0.15),
    (0.22, 0.24, 0.27),
    (0.40, 0.62, 0.78),
)
TIMBER: Rgb = (0.50, 0.34, 0.20)
LONGEST_RAKE_M = 0.5  # how far a bow overhangs the waterline


def hull(
    length_m: float,
    width_m: float,
    freeboard_m: float,
    topside: Rgb,
    *,
    bottom: Rgb = (0.25, 0.10, 0.09),
    stripe: Rgb | None = None,
    bow_power: float = 2.2,
    stern: float = 0.8,
    deck: Rgb | None = (0.80, 0.78, 0.72),
    material: int = 0,
) -> Mesh:
    """A lofted hull with sheer; `stern` is the transom's share of the beam; open without `deck`."""
    at = np.linspace(0.0, 1.0, 13)
    half = np.where(
        at < 0.45,
        stern + (1.0 - stern) * np.sin(0.5 * np.pi * at / 0.45),
        1.0 - np.clip((at - 0.45) / 0.55, 0.0, 1.0) ** bow_power,
    )
    half = 0.5 * width_m * np.maximum(half, 0.015)
    sheer = freeboard_m * (1.0 + 0.45 * np.clip((at - 0.4) / 0.6, 0.0, 1.0) ** 2)
    raked_m = min(0.10 * length_m, LONGEST_RAKE_M)
    rake = raked_m * np.clip((at - 0.5) / 0.5, 0.0, 1.0) ** 2
    depth = np.array([-0.25, 0.0, 0.10, 0.75, 0.92, 1.0])
    flare = np.array([0.70, 0.86, 0.89, 0.98, 1.0, 1.0])
    x = (at * (length_m - raked_m) - 0.5 * length_m)[:, None] + rake[:, None] * np.clip(depth, 0.0, 1.0)[None] ** 0.8
    y = half[:, None] * flare[None]
    z = np.where(depth < 0.0, depth * 1.2, depth * sheer[:, None])
    rows = np.array([bottom, bottom, topside, topside, stripe or topside, stripe or topside])
    colours = np.broadcast_to(rows[None], (13, 6, 3))
    skin = np.stack([x, y, np.broadcast_to(z, x.shape)], axis=-1)
    other = skin * np.array([1.0, -1.0, 1.0])
    parts = [loft(skin[::-1], colours, material), loft(other, colours, material)]
    transom = np.stack([skin[0], other[0]])
    parts.append(loft(transom, np.broadcast_to(rows[None], (2, 6, 3)), material))
    if deck is None:
        floor = skin[:, 3] * np.array([1.0, 0.86, 1.0]) - [0.0, 0.0, 0.55 * freeboard_m]
        rim = skin[:, -1] * np.array([1.0, 0.95, 1.0])
        inner: Rgb = (0.62 * topside[0], 0.60 * topside[1], 0.56 * topside[2])
        for sign in (1.0, -1.0):
            flip = np.array([1.0, sign, 1.0])
            parts.append(loft(np.stack([rim * flip, floor * flip]), inner, material))
        parts.append(loft(np.stack([floor, floor * [1.0, -1.0, 1.0]]), inner, material))
    else:
        parts.append(loft(np.stack([skin[:, -1], other[:, -1]]), deck))
    return merge(*parts)
