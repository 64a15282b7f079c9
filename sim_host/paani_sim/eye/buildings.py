"""Houses, warehouses and cranes as meshes: long side along x, ground at z = 0."""

import numpy as np

from paani_sim.eye.mesh import BRICK, FACADE, GLASS, WOOD, Mesh, Rgb, box, loft, merge, placed, rod

ROOFS: tuple[Rgb, ...] = ((0.45, 0.20, 0.15), (0.28, 0.28, 0.30), (0.36, 0.24, 0.18))
CRANES: tuple[Rgb, ...] = ((0.85, 0.62, 0.10), (0.20, 0.36, 0.52), (0.62, 0.20, 0.14), (0.42, 0.46, 0.44))
DOORS: tuple[Rgb, ...] = ((0.22, 0.34, 0.28), (0.34, 0.20, 0.14), (0.20, 0.24, 0.34))


def house(width_m: float, depth_m: float, wall_m: float, variant: int) -> Mesh:
    """A house with a gable roof."""
    walls: tuple[Rgb, ...] = (
        (0.86, 0.82, 0.74),
        (0.70, 0.42, 0.32),
        (0.90, 0.90, 0.88),
        (0.78, 0.70, 0.52),
    )
    wall = walls[variant % 4]
    body = placed(box((width_m, depth_m, wall_m + 2.0), wall, FACADE), (0, 0, 0.5 * wall_m - 1.0))
    ridge_m = wall_m + 0.42 * depth_m
    chimney = placed(box((0.7, 0.7, 1.6), (0.45, 0.25, 0.2)), (0.25 * width_m, 0.0, ridge_m))
    return merge(body, *_gable(width_m, depth_m, wall_m, ridge_m, wall, ROOFS[variant % 3]), chimney)


def _gable(width_m: float, depth_m: float, wall_m: float, ridge_m: float, wall: Rgb, roof: Rgb) -> list[Mesh]:
    """A roof with its ridge along x, and the walls' triangles under it."""
    half_w, half_d = 0.5 * width_m + 0.4, 0.5 * depth_m + 0.5
    parts = []
    for side in (1.0, -1.0):
        eaves = [(-half_w, side * half_d, wall_m - 0.2), (half_w, side * half_d, wall_m - 0.2)]
        top = [(-half_w, 0.0, ridge_m), (half_w, 0.0, ridge_m)]
        parts.append(loft(np.array([eaves, top] if side > 0 else [top, eaves]), roof, WOOD))
        x = side * 0.5 * width_m
        gable = np.array(
            [
                [(x, -0.5 * depth_m, wall_m - 0.1)] * 2,
                [(x, 0.0, ridge_m - 0.1), (x, 0.5 * depth_m, wall_m - 0.1)],
            ]
        )
        parts.append(loft(gable, wall))
    return parts


def warehouse(length_m: float, width_m: float, height_m: float, variant: int) -> Mesh:
    """A brick store: loading doors and rows of windows on both long sides, a low gable roof, a hoist beam."""
    tone = 1.0 - 0.10 * (variant % 3)
    brick: Rgb = (
        (0.58 * tone, 0.34 * tone, 0.26 * tone) if variant % 2 == 0 else (0.66 * tone, 0.60 * tone, 0.50 * tone)
    )
    wall_m = height_m - 0.22 * width_m
    parts = [placed(box((length_m, width_m, wall_m + 0.6), brick, BRICK), (0.0, 0.0, 0.5 * wall_m - 0.3))]
    parts += _gable(length_m, width_m, wall_m, height_m, brick, ROOFS[(variant + 1) % 3])
    bays = max(2, round(length_m / 4.0))
    floors = max(1, round(wall_m / 3.2))
    door = DOORS[variant % len(DOORS)]
    for bay in range(bays):
        x = ((bay + 0.5) / bays - 0.5) * length_m
        for floor in range(floors):
            z = (floor + 0.5) * wall_m / floors
            loading = bay % 3 == 1
            if loading:
                part = placed(box((1.9, width_m + 0.14, 0.82 * wall_m / floors), door, WOOD), (x, 0.0, z - 0.2))
            else:
                part = placed(box((1.2, width_m + 0.10, 0.45 * wall_m / floors), (0.10, 0.12, 0.14), GLASS), (x, 0, z))
            parts.append(part)
            lintel = box((2.1 if loading else 1.5, width_m + 0.16, 0.18), (0.70, 0.68, 0.62))
            parts.append(placed(lintel, (x, 0.0, z + (0.36 if loading else 0.27) * wall_m / floors)))
    beam = box((0.25, width_m + 2.0, 0.3), (0.2, 0.2, 0.2))
    parts.append(placed(beam, (0.0, 0.0, wall_m - 0.35)))
    return merge(*parts)


def crane(length_m: float, width_m: float, height_m: float, variant: int) -> Mesh:
    """A harbour crane on a portal; its jib points to +x and reaches beyond the footprint."""
    rgb = CRANES[variant % len(CRANES)]
    dark: Rgb = (0.16, 0.17, 0.18)
    portal_m, cab_m = 0.32 * height_m, 0.16 * height_m
    parts = []
    for x in (-0.42, 0.42):
        for y in (-0.42, 0.42):
            foot = (x * length_m, y * width_m, 0.0)
            parts.append(rod(foot, (0.6 * x * length_m, 0.6 * y * width_m, portal_m), 0.22, rgb, 6))
            parts.append(placed(box((0.9, 0.35, 0.5), dark), (foot[0], foot[1], 0.25)))
    parts.append(placed(box((0.66 * length_m, 0.66 * width_m, 0.5), rgb), (0.0, 0.0, portal_m)))
    parts.append(
        placed(box((0.62 * length_m, 0.5 * width_m, cab_m), rgb), (-0.1 * length_m, 0, portal_m + 0.6 * cab_m))
    )
    pane = box((0.2 * length_m, 0.42 * width_m, 0.45 * cab_m), (0.1, 0.13, 0.15), GLASS)
    parts.append(placed(pane, (0.15 * length_m, 0.0, portal_m + 0.75 * cab_m)))
    heel, mast = portal_m + 0.6 * cab_m, (-0.12 * length_m, 0.0, 0.80 * height_m)
    tip = (0.9 * height_m, 0.0, height_m)
    for y in (-0.14, 0.14):
        parts.append(rod((0.2 * length_m, y * width_m, heel), tip, 0.16, rgb, 5, end_radius_m=0.08))
        parts.append(rod((-0.3 * length_m, y * width_m, heel), mast, 0.14, rgb, 5))
    for k in range(1, 7):
        part = k / 7.0
        spot = (0.2 * length_m + part * (tip[0] - 0.2 * length_m), 0.0, heel + part * (tip[2] - heel))
        parts.append(placed(box((0.10, 0.28 * width_m * (1.0 - part) + 0.1, 0.10), rgb), spot))
    parts.append(rod(mast, tip, 0.05, dark, 4))
    parts.append(rod(tip, (tip[0], 0.0, 0.45 * height_m), 0.035, dark, 4))
    parts.append(placed(box((0.35, 0.35, 0.5), dark), (tip[0], 0.0, 0.45 * height_m)))
    return merge(*parts)
