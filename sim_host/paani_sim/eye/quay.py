"""Quay walls around a world's water: masonry, coping, paved ground and what stands on it. Pure numpy."""

import numpy as np

from paani.arrays import F64
from paani_sim.eye.mesh import BRICK, PAVING, STONE, WOOD, Mesh, Rgb, box, grid_triangles, merge, mesh, placed, rod
from paani_sim.worlds.curves import clearance_m, closed_length_m, point_along_closed
from paani_sim.worlds.world import World

QUAY_TOP_M = 0.9
PAVED_M = 9.0  # from the edge inland
EDGE_M = 0.45  # width of the coping
STEP_M = 3.0  # of the wall along the water
GRID_M = 2.5
WALL_FOOT_M = -2.5
FENDER_EVERY_M, BOLLARD_EVERY_M, LADDER_EVERY_M, LAMP_EVERY_M = 6.5, 11.0, 24.0, 19.0
WALLS: tuple[tuple[Rgb, int], ...] = (
    ((0.52, 0.36, 0.29), BRICK),
    ((0.58, 0.55, 0.49), STONE),
    ((0.60, 0.59, 0.56), PAVING),
)
COPING: Rgb = (0.68, 0.66, 0.61)
GROUND: tuple[Rgb, ...] = ((0.50, 0.47, 0.43), (0.55, 0.54, 0.52), (0.46, 0.40, 0.36))
IRON: Rgb = (0.13, 0.14, 0.15)


def quay(world: World, rng: np.random.Generator) -> Mesh:
    """The wall with its coping, and the paved ground."""
    ring = _divided(world.shore_m)
    wall_rgb, wall_material = WALLS[int(rng.integers(len(WALLS)))]
    ground_rgb = GROUND[int(rng.integers(len(GROUND)))]
    return merge(_wall(ring, wall_rgb, wall_material), _paved(world, ring, ground_rgb))


def _divided(shore_m: F64) -> F64:
    """The same polygon, its corners kept, with edges of at most `STEP_M`."""
    pieces = []
    for start, end in zip(shore_m, np.roll(shore_m, -1, axis=0), strict=True):
        count = max(1, int(np.ceil(np.hypot(*(end - start)) / STEP_M)))
        pieces.append(start + np.arange(count)[:, None] / count * (end - start))
    return np.vstack(pieces)


def _outward(ring: F64) -> tuple[F64, F64]:
    """Unit normals `(n, 2)` of the edges towards land, and mitred ones of the points."""
    edge = np.roll(ring, -1, axis=0) - ring
    length = np.maximum(np.hypot(edge[:, 0], edge[:, 1]), 1e-9)
    normal = np.column_stack([edge[:, 1], -edge[:, 0]]) / length[:, None]
    both = normal + np.roll(normal, 1, axis=0)
    return normal, 2.0 * both / np.maximum((both**2).sum(axis=1, keepdims=True), 1.0)


def _wall(ring: F64, rgb: Rgb, material: int) -> Mesh:
    """Flat faces, each with its own normal: the wall, the coping's front, its overhang's top."""
    normal, mitre = _outward(ring)
    after, mitre_after = np.roll(ring, -1, axis=0), np.roll(mitre, -1, axis=0)
    low, high = QUAY_TOP_M - 0.22, QUAY_TOP_M
    front = -0.07
    parts = []
    for (out_a, z_a), (out_b, z_b), up, paint, kind in (
        ((0.0, WALL_FOOT_M), (0.0, low), 0.0, rgb, material),
        ((0.0, low), (front, low), -1.0, COPING, STONE),
        ((front, low), (front, high), 0.0, COPING, STONE),
        ((front, high), (EDGE_M, high), 1.0, COPING, PAVING),
    ):
        corners = [
            np.column_stack([at + out * way, np.full(len(ring), z)])
            for at, way, out, z in (
                (ring, mitre, out_a, z_a),
                (after, mitre_after, out_a, z_a),
                (after, mitre_after, out_b, z_b),
                (ring, mitre, out_b, z_b),
            )
        ]
        points = np.stack(corners, axis=1).reshape(-1, 3)
        flat = np.column_stack([-normal * (up == 0.0), np.full(len(ring), up)])
        quads = 4 * np.arange(len(ring))[:, None] + np.array([0, 1, 2, 0, 2, 3])
        parts.append(mesh(points, np.repeat(flat, 4, axis=0), quads, paint, kind))
    return merge(*parts)


def _paved(world: World, ring: F64, rgb: Rgb) -> Mesh:
    """Level ground from the coping to `PAVED_M` inland: a strip along the edge, a grid for what it leaves open."""
    _, mitre = _outward(ring)
    rows = (EDGE_M, 1.2, 2.4, 4.0, 6.0, PAVED_M + 1.0)
    closed, way = np.vstack([ring, ring[:1]]), np.vstack([mitre, mitre[:1]])
    strip = np.stack([closed + out * way for out in rows])
    low, high = world.shore_m.min(axis=0) - PAVED_M, world.shore_m.max(axis=0) + PAVED_M
    x, y = np.arange(low[0], high[0], GRID_M), np.arange(low[1], high[1], GRID_M)
    grid = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)
    parts = []
    for sheet, deepest_m, z in ((strip, 0.3, QUAY_TOP_M), (grid, 0.5 * EDGE_M + 0.75 * GRID_M, QUAY_TOP_M - 0.01)):
        flat = sheet.reshape(-1, 2)
        clear = clearance_m(world.shore_m, flat)
        triangles = grid_triangles(*sheet.shape[:2])
        ashore = (clear[triangles] < -0.9 * deepest_m).all(axis=1) & (clear[triangles] > -PAVED_M - 4.0).all(axis=1)
        points = np.column_stack([flat, np.full(len(flat), z)])
        parts.append(mesh(points, (0.0, 0.0, 1.0), triangles[ashore], rgb, PAVING))
    return merge(*parts)


def furniture(world: World, rng: np.random.Generator) -> tuple[Mesh, ...]:
    """Fenders and ladders on the wall, bollards and lamp posts on the edge, here and there a bench."""
    length = closed_length_m(world.shore_m)
    found: list[Mesh] = []
    for every_m, out_m, build in (
        (FENDER_EVERY_M, 0.0, _fender),
        (LADDER_EVERY_M, 0.0, _ladder),
        (BOLLARD_EVERY_M, 0.75, _bollard),
        (LAMP_EVERY_M, 3.2, _lamp),
        (31.0, 4.4, _bench),
    ):
        at_m = float(rng.uniform(0.0, every_m))
        while at_m < length:
            x_m, y_m, yaw = point_along_closed(world.shore_m, at_m)
            at_m += every_m * float(rng.uniform(0.85, 1.2))
            spot = np.array([x_m + out_m * np.sin(yaw), y_m - out_m * np.cos(yaw)])
            if out_m > 0.0 and clearance_m(world.shore_m, spot[None])[0] > -0.8 * out_m:
                continue
            found.append(placed(build(), (float(spot[0]), float(spot[1]), QUAY_TOP_M), yaw_rad=yaw))
    return tuple(found)


# Along the wall is x, the water lies at +y, the ground at z = 0.


def _fender() -> Mesh:
    return placed(box((0.22, 0.20, 1.1), (0.07, 0.07, 0.08)), (0.0, 0.14, -0.62))


def _ladder() -> Mesh:
    parts = [rod((x, 0.16, -1.9), (x, 0.16, 0.1), 0.03, IRON, 4) for x in (-0.21, 0.21)]
    parts += [rod((-0.21, 0.16, z), (0.21, 0.16, z), 0.02, IRON, 4) for z in np.arange(-1.8, 0.05, 0.3).tolist()]
    return merge(*parts)


def _bollard() -> Mesh:
    return merge(rod((0, 0, 0), (0, 0, 0.42), 0.12, IRON, 8), rod((0, 0, 0.40), (0, 0, 0.52), 0.18, IRON, 8))


def _lamp() -> Mesh:
    return merge(
        rod((0, 0, 0), (0, 0, 0.8), 0.10, IRON, 6),
        rod((0, 0, 0.8), (0, 0, 4.2), 0.05, IRON, 6),
        placed(box((0.34, 0.34, 0.42), (0.86, 0.84, 0.74)), (0.0, 0.0, 4.4)),
        placed(box((0.44, 0.44, 0.10), IRON), (0.0, 0.0, 4.66)),
    )


def _bench() -> Mesh:
    parts = [placed(box((1.7, 0.42, 0.06), (0.46, 0.33, 0.20), WOOD), (0.0, 0.0, 0.45))]
    parts.append(placed(box((1.7, 0.05, 0.40), (0.46, 0.33, 0.20), WOOD), (0.0, -0.22, 0.72)))
    parts += [placed(box((0.08, 0.40, 0.45), IRON), (x, 0.0, 0.22)) for x in (-0.7, 0.7)]
    return merge(*parts)
