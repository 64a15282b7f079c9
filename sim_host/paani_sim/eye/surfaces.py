"""Periodic textures of surface materials, one layer each, which the solid shader samples. Pure numpy.

Every layer is `(TILE, TILE, 4)` uint8, periodic. Layer 0 is noise; in the others channel 1 is brightness around 128.
"""

import numpy as np

from paani.arrays import F64, U8
from paani_sim.eye.wave_textures import TILE, noise_tile

NOISE, BRICKS, BLOCKS, SETTS = range(4)
SPAN_M = (1.0, 1.92, 4.0, 3.2)  # what one tile of a layer spans on its surface; layer 0 is scaled in the shader


def surface_tiles(seed: int) -> U8:
    """All layers `(4, TILE, TILE, 4)`."""
    rng = np.random.default_rng([seed, 3])
    noise = noise_tile(seed)
    return np.stack(
        [
            noise,
            _laid(noise, _courses(rng, rows=24, pieces=8, joint_px=1.6, spread=0.20), 0.30),
            _laid(noise, _courses(rng, rows=10, pieces=5, joint_px=2.2, spread=0.13), 0.55),
            _laid(noise, _courses(rng, rows=20, pieces=16, joint_px=2.0, spread=0.12), 0.45),
        ]
    )


def _courses(rng: np.random.Generator, *, rows: int, pieces: int, joint_px: float, spread: float) -> F64:
    """Brightness about 1 of rows of pieces in running bond with darker joints."""
    y, x = np.mgrid[0:TILE, 0:TILE] + 0.5
    edges = np.linspace(0.0, TILE, rows + 1)
    row = np.clip(np.searchsorted(edges, y[:, 0], side="right") - 1, 0, rows - 1)
    height = TILE / rows
    from_row = np.abs(((y[:, 0] - edges[row]) % height) - 0.5 * height)
    shift = np.where(row % 2 == 0, 0.0, 0.5) + rng.uniform(-0.12, 0.12, rows)[row]
    along = x / TILE * pieces + shift[:, None]
    piece = np.floor(along).astype(int) % pieces
    from_end = np.abs(along - np.floor(along) - 0.5) * TILE / pieces
    shade = 1.0 + rng.normal(0.0, spread, (rows, pieces))
    light = shade[row[:, None], piece]
    joint = (from_row[:, None] > 0.5 * (height - joint_px)) | (from_end > 0.5 * (TILE / pieces - joint_px))
    return np.where(joint, 0.62, light)


def _laid(noise: U8, light: F64, roughness: float) -> U8:
    """The noise tile with channel 1 as the pattern, weathered by the noise."""
    tile = noise.copy()
    worn = light * (1.0 + roughness * (noise[..., 2] / 255.0 - 0.5) + 0.25 * (noise[..., 3] / 255.0 - 0.5))
    tile[..., 1] = np.clip(np.round(worn * 128.0), 0, 255)
    return tile
