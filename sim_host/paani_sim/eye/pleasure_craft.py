"""Rowing eight, paddle board, water scooter and ferry: bow along +x, waterline at z = 0, centred. Pure numpy."""

import numpy as np

from paani_sim.eye.hull import DARK, HULLS, WHITE, hull
from paani_sim.eye.mesh import GLASS, Mesh, Rgb, box, ellipsoid, loft, merge, placed, rod
from paani_sim.eye.people import person

BLADES: tuple[Rgb, ...] = ((0.85, 0.12, 0.10), (0.95, 0.80, 0.10), (0.10, 0.30, 0.62), (0.92, 0.92, 0.90))
SEAT_M, SEATS = 1.32, 8
CARBON: Rgb = (0.16, 0.16, 0.17)
BOARDS: tuple[Rgb, ...] = ((0.20, 0.62, 0.72), (0.93, 0.50, 0.12), (0.90, 0.88, 0.80), (0.62, 0.78, 0.20))


def eight(length: float, width: float, height: float, rgb: Rgb, variant: int) -> list[Mesh]:
    """Eight rowers who face aft, a cox who looks ahead past them; `width` is from blade to blade."""
    at = np.linspace(-1.0, 1.0, 25)
    half = 0.29 * np.sqrt(np.maximum(1e-4, 1.0 - np.abs(at) ** 2.6))
    around = np.linspace(-0.15 * np.pi, 1.15 * np.pi, 9)
    top = 0.24 + 0.05 * at**4
    skin = np.stack(
        [
            np.broadcast_to(0.5 * length * at[:, None], (25, 9)),
            half[:, None] * np.cos(around),
            top[:, None] * np.sin(around),
        ],
        axis=-1,
    )
    parts, crew = [loft(skin[::-1], rgb)], []
    blade_rgb, swept = BLADES[variant % len(BLADES)], (0.5, 0.0, -0.5)[variant % 3]
    lifted = 0.32 if variant % 2 else 0.06
    for seat in range(SEATS):
        x, side = (seat - 3.1) * SEAT_M, 1.0 if seat % 2 else -1.0
        pin = (x - 0.35, side * 0.82, 0.42)
        tip = (x - 0.35 + swept, side * 0.5 * width, lifted)
        parts += [
            rod((x - 0.35, side * 0.24, 0.26), pin, 0.025, CARBON),
            rod((x - 0.12 - 0.15 * swept, side * 0.16, 0.50), tip, 0.028, CARBON, end_radius_m=0.02),
            placed(box((0.10, 0.55, 0.24), blade_rgb), (tip[0], side * (0.5 * width - 0.28), lifted)),
        ]
        rower = person("sitting", 0.86 * height, variant + 3 * seat)
        crew.append(placed(rower, (x, 0.0, 0.14), yaw_rad=np.pi))
    crew.append(placed(person("sitting", 0.72 * height, variant + 1), (-4.1 * SEAT_M - 0.75, 0.0, 0.14)))
    parts.append(placed(ellipsoid((0.06, 0.06, 0.06), WHITE), (0.5 * length - 0.06, 0.0, 0.29)))
    return [merge(*parts), *crew]


def paddleboard(length: float, width: float, height: float, rgb: Rgb, variant: int) -> list[Mesh]:
    """A board with somebody who stands on it."""
    at = np.linspace(-1.0, 1.0, 13)
    half = 0.5 * width * np.sqrt(np.maximum(0.02, 1.0 - np.abs(at) ** 2.6))
    nose = 0.12 * np.clip(at - 0.5, 0.0, 1.0)
    deck = np.stack(
        [np.column_stack([0.5 * length * at, side * half * fill, z + nose]) for side, fill, z in _BOARD_SECTION],
        axis=1,
    )
    board = loft(deck[::-1], BOARDS[variant % len(BOARDS)])
    pad = placed(box((0.36 * length, 0.62 * width, 0.02), (0.34, 0.36, 0.38)), (-0.06 * length, 0.0, 0.11))
    side = 1.0 if variant % 2 else -1.0
    standing = person("standing", height - 0.12, variant | 1)
    shaft = rod((0.42, side * 0.50, -0.1), (0.20, side * 0.10, 0.80 * height), 0.018, CARBON)
    blade = placed(box((0.03, 0.18, 0.40), BLADES[variant % len(BLADES)]), (0.44, side * 0.52, 0.0))
    return [merge(board, pad), placed(merge(standing, shaft, blade), (-0.06 * length, 0.0, 0.11))]


_HALF_SECTION = ((1.0, 0.0, 0.11), (1.0, 0.9, 0.10), (1.0, 1.0, 0.03), (1.0, 0.8, -0.05))
_BOARD_SECTION = (*_HALF_SECTION, *((-side, fill, z) for side, fill, z in reversed(_HALF_SECTION)))


def jetski(length: float, width: float, height: float, rgb: Rgb, variant: int) -> list[Mesh]:
    """A water scooter and who rides it."""
    free = 0.20 * height
    accent = HULLS[(variant + 2) % len(HULLS)]
    parts = [
        hull(length, width, free, rgb, stripe=accent, stern=0.85, deck=(0.20, 0.21, 0.22)),
        placed(ellipsoid((0.26 * length, 0.30 * width, 0.17 * height), accent), (0.16 * length, 0.0, 1.5 * free)),
        placed(ellipsoid((0.28 * length, 0.19 * width, 0.15 * height), DARK), (-0.18 * length, 0.0, 1.5 * free)),
        rod((0.07 * length, -0.34 * width, 2.9 * free), (0.07 * length, 0.34 * width, 2.9 * free), 0.03, DARK),
        rod((0.16 * length, 0.0, 1.6 * free), (0.07 * length, 0.0, 2.9 * free), 0.06, DARK),
    ]
    rider = person("sitting", 0.66 * height, variant)
    return [merge(*parts), placed(rider, (-0.16 * length, 0.0, 1.9 * free))]


def ferry(length: float, width: float, height: float, rgb: Rgb, variant: int) -> list[Mesh]:
    """A passenger ferry: bluff bow, saloon with a row of windows, an upper deck and a wheelhouse."""
    free = 0.22 * height
    lower, upper = 0.34 * height, 0.30 * height
    livery = HULLS[1 + variant % 4]
    parts = [hull(length, width, free, livery, stripe=WHITE, stern=0.95, bow_power=6.0, deck=(0.42, 0.46, 0.44))]
    saloon_l, x = 0.68 * length, -0.06 * length
    parts.append(placed(box((saloon_l, 0.84 * width, lower), WHITE), (x, 0.0, free + 0.5 * lower)))
    count = max(4, round(saloon_l / 1.3))
    for k in range(count):
        pane = box((0.72 * saloon_l / count, 0.85 * width, 0.46 * lower), (0.09, 0.12, 0.14), GLASS)
        parts.append(placed(pane, (x + ((k + 0.5) / count - 0.5) * 0.94 * saloon_l, 0.0, free + 0.60 * lower)))
    front = box((0.02, 0.70 * width, 0.46 * lower), (0.09, 0.12, 0.14), GLASS)
    parts.append(placed(front, (x + 0.5 * saloon_l + 0.01, 0.0, free + 0.60 * lower)))
    roof_z = free + lower
    parts.append(placed(box((saloon_l + 0.5, 0.92 * width, 0.10), livery), (x, 0.0, roof_z)))
    house_x = x + 0.26 * saloon_l
    house = box((0.22 * saloon_l, 0.56 * width, upper), WHITE)
    glass = box((0.225 * saloon_l, 0.57 * width, 0.42 * upper), (0.08, 0.11, 0.13), GLASS)
    parts += [
        placed(house, (house_x, 0.0, roof_z + 0.5 * upper)),
        placed(glass, (house_x, 0.0, roof_z + 0.66 * upper)),
        placed(box((0.26 * saloon_l, 0.64 * width, 0.08), livery), (house_x, 0.0, roof_z + upper)),
        rod((house_x, 0.0, roof_z + upper), (house_x, 0.0, height), 0.05, WHITE),
        rod((x - 0.02 * length, 0.0, roof_z), (x - 0.02 * length, 0.0, roof_z + 0.8 * upper), 0.28, livery, 10),
    ]
    for side in (1.0, -1.0):
        y = side * 0.43 * width
        ends = (x - 0.48 * saloon_l, x + 0.12 * saloon_l)
        parts += [rod((ends[0], y, roof_z + z), (ends[1], y, roof_z + z), 0.025, WHITE) for z in (0.5, 0.95)]
        parts += [rod((p, y, roof_z), (p, y, roof_z + 0.95), 0.025, WHITE) for p in np.linspace(*ends, 6).tolist()]
    crew = [
        placed(person("standing", 1.72, variant + 2 * k), (x - (0.14 + 0.10 * k) * saloon_l, 0.2 * width, roof_z))
        for k in range(variant % 4)
    ]
    return [merge(*parts), *crew]
