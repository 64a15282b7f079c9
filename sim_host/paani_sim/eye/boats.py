"""Boats as meshes: bow along +x, waterline at z = 0, centred on the origin. Pure numpy."""

import numpy as np

from paani_sim.eye.barges import barge, narrowboat, tug, workboat
from paani_sim.eye.hull import DARK, HULLS, TIMBER, WHITE, hull
from paani_sim.eye.mesh import GLASS, WOOD, Mesh, Rgb, box, ellipsoid, loft, merge, placed, rod
from paani_sim.eye.people import person
from paani_sim.eye.pleasure_craft import eight, ferry, jetski, paddleboard


def boat(look: str, length_m: float, width_m: float, height_m: float, variant: int) -> list[Mesh]:
    """The boat's parts; people aboard come last, each as a mesh of their own."""
    build = {
        "rowboat": _rowboat,
        "dinghy": _dinghy,
        "kayak": _kayak,
        "cruiser": _cruiser,
        "sailboat": _sailboat,
        "workboat": workboat,
        "barge": barge,
        "pontoonboat": _pontoonboat,
        "narrowboat": narrowboat,
        "tug": tug,
        "eight": eight,
        "paddleboard": paddleboard,
        "jetski": jetski,
        "ferry": ferry,
    }[look]
    return build(length_m, width_m, height_m, HULLS[variant % len(HULLS)], variant)


BOAT_LOOKS = (  # of the boats in labelled pictures: the same arguments give the same pictures
    "rowboat",
    "dinghy",
    "kayak",
    "cruiser",
    "sailboat",
    "workboat",
    "barge",
    "pontoonboat",
    "narrowboat",
    "tug",
)


def _rowboat(length: float, width: float, height: float, rgb: Rgb, variant: int) -> list[Mesh]:
    wooden = variant % 2 == 0
    topside = TIMBER if wooden else rgb
    free = min(0.45, height)
    shell = hull(
        length,
        width,
        free,
        topside,
        deck=None,
        stripe=(0.30, 0.20, 0.12),
        bow_power=1.8,
        material=WOOD if wooden else 0,
    )
    parts = [shell]
    for x in (-0.28, 0.02, 0.28):
        thwart = box((0.22, 0.86 * width, 0.04), (0.58, 0.42, 0.26), WOOD)
        parts.append(placed(thwart, (x * length, 0.0, 0.72 * free)))
    for side in (1.0, -1.0):
        oar = rod(
            (-0.2 * length, side * 0.3 * width, free),
            (0.30 * length, side * 0.36 * width, free + 0.03),
            0.025,
            (0.72, 0.60, 0.42),
        )
        parts.append(oar)
    crew = [placed(person("sitting", 1.25, variant), (0.0, 0.0, 0.1))] if variant % 3 == 2 else []
    return [merge(*parts), *crew]


def _dinghy(length: float, width: float, height: float, rgb: Rgb, variant: int) -> list[Mesh]:
    tube: Rgb = rgb if variant % 2 else (0.55, 0.57, 0.58)
    radius = 0.19 * width
    around = np.linspace(0.0, 2.0 * np.pi, 9)
    at = np.linspace(0.0, 1.0, 15)
    bend = np.clip((at - 0.55) / 0.45, 0.0, 1.0)
    line = np.column_stack(
        [
            (at - 0.5) * length * 0.94,
            (0.5 * width - radius) * np.cos(0.5 * np.pi * bend**1.6),
            0.6 * radius + 0.18 * bend**2,
        ]
    )
    ring = np.stack([np.zeros(9), np.cos(around), np.sin(around)], axis=-1) * radius
    parts = []
    for side in (1.0, -1.0):
        skin = line[:, None] * np.array([1.0, side, 1.0]) + ring[None]
        parts.append(loft(skin, tube))
        end = ellipsoid((0.14, radius, radius), DARK)
        parts.append(placed(end, (float(line[0, 0]), side * float(line[0, 1]), 0.6 * radius)))
    parts.append(placed(box((0.8 * length, 0.7 * width, 0.06), (0.35, 0.36, 0.37)), (0, 0, 0.12)))
    motor_x = -0.49 * length
    parts.append(placed(box((0.26, 0.22, 0.34), DARK), (motor_x, 0.0, 0.72)))
    parts.append(placed(box((0.12, 0.10, 0.6), (0.2, 0.2, 0.2)), (motor_x, 0.0, 0.3)))
    crew = []
    if variant % 2 == 1:
        crew = [placed(person("sitting", min(1.25, height + 0.5), variant + 3), (-0.8, 0.3, 0.12))]
    return [merge(*parts), *crew]


def _kayak(length: float, width: float, height: float, rgb: Rgb, variant: int) -> list[Mesh]:
    bright = ((0.92, 0.45, 0.08), (0.85, 0.12, 0.10), (0.95, 0.80, 0.10), (0.10, 0.45, 0.75))
    shell = bright[variant % len(bright)]
    at = np.linspace(-1.0, 1.0, 15)
    half = 0.5 * width * np.sqrt(np.maximum(1e-4, 1.0 - np.abs(at) ** 2.4))
    top = 0.20 + 0.16 * at**4
    around = np.linspace(-0.15 * np.pi, 1.15 * np.pi, 9)
    skin = np.stack(
        [
            np.broadcast_to(0.5 * length * at[:, None], (15, 9)),
            half[:, None] * np.cos(around),
            top[:, None] * np.sin(around),
        ],
        axis=-1,
    )
    cockpit = placed(ellipsoid((0.42, 0.26, 0.06), DARK), (-0.1, 0.0, 0.2))
    paddler = placed(person("paddling", max(height - 0.05, 0.95), variant), (-0.15, 0.0, 0.08))
    return [merge(loft(skin[::-1], shell), cockpit), paddler]


def _cruiser(length: float, width: float, height: float, rgb: Rgb, variant: int) -> list[Mesh]:
    free = 0.36 * height
    accent = HULLS[(variant + 1) % len(HULLS)] if rgb == WHITE else WHITE
    parts = [hull(length, width, free, rgb, stripe=accent, stern=0.9)]
    cabin_l, cabin_h = 0.34 * length, height - 1.15 * free
    at = np.array([[-0.5, 1.0], [0.42, 1.0], [0.26, 0.0], [-0.44, 0.0]])
    for low, high, rgb_part, material in (
        (0.0, 0.42, WHITE, 0),
        (0.42, 0.84, (0.10, 0.13, 0.16), GLASS),
        (0.84, 1.0, WHITE, 0),
    ):
        ring = []
        for level in (low, high):
            tilt = level * (at[2:, 0][::-1] - at[:2, 0])
            x0, x1 = (at[:2, 0] + tilt) * cabin_l
            half = 0.40 * width * (1.0 - 0.14 * level)
            z = level * cabin_h
            ring.append([(x0, -half, z), (x1, -half, z), (x1, half, z), (x0, half, z), (x0, -half, z)])
        wall = np.array(ring)
        for corner in range(4):
            parts.append(
                placed(
                    loft(wall[:, corner : corner + 2], rgb_part, material),
                    (0.02 * length, 0.0, 1.05 * free),
                )
            )
    roof = box((0.78 * cabin_l, 0.74 * width, 0.07), WHITE)
    parts.append(placed(roof, (-0.02 * length, 0.0, 1.05 * free + cabin_h)))
    for side in (1.0, -1.0):
        rail_y = side * 0.40 * width
        bow_z = 1.25 * free + 0.55
        parts.append(
            rod(
                (0.22 * length, rail_y, bow_z - 0.12),
                (0.44 * length, 0.12 * rail_y, bow_z + 0.06),
                0.03,
                (0.75, 0.77, 0.78),
            )
        )
        for x, pull in ((0.22, 1.0), (0.33, 0.66), (0.42, 0.25)):
            parts.append(
                rod(
                    (x * length, pull * rail_y, free),
                    (x * length, pull * rail_y, bow_z),
                    0.025,
                    (0.75, 0.77, 0.78),
                )
            )
    parts.append(placed(box((0.30, 0.36, 0.55), DARK), (-0.47 * length, 0.0, 0.75 * free)))
    seat = box((0.1 * length, 0.6 * width, 0.25), (0.75, 0.70, 0.62))
    parts.append(placed(seat, (-0.36 * length, 0.0, 1.15 * free)))
    crew = []
    if variant % 3 == 2:
        crew = [placed(person("standing", 1.7, variant), (-0.27 * length, 0.2, 0.75 * free))]
    return [merge(*parts), *crew]


def _sailboat(length: float, width: float, height: float, rgb: Rgb, variant: int) -> list[Mesh]:
    free = 0.12 * length
    parts = [hull(length, width, free, rgb, stripe=DARK, stern=0.65, deck=(0.78, 0.70, 0.55))]
    cabin = placed(box((0.36 * length, 0.5 * width, 0.34), WHITE), (0.04 * length, 0, free + 0.15))
    window = box((0.28 * length, 0.51 * width, 0.13), (0.09, 0.11, 0.13), GLASS)
    parts += [cabin, placed(window, (0.04 * length, 0.0, free + 0.2))]
    mast_x, foot = 0.10 * length, free
    metal: Rgb = (0.78, 0.79, 0.80)
    parts.append(rod((mast_x, 0, foot), (mast_x, 0, height), 0.07, metal, end_radius_m=0.045))
    boom_z = foot + 0.95
    parts.append(rod((mast_x, 0, boom_z), (-0.36 * length, 0, boom_z + 0.05), 0.055, metal))
    for x, y in (
        (0.49 * length, 0.0),
        (-0.45 * length, 0.0),
        (mast_x, 0.48 * width),
        (mast_x, -0.48 * width),
    ):
        parts.append(rod((x, y, free), (mast_x, 0.0, 0.96 * height), 0.018, (0.5, 0.5, 0.5), 4))
    cover: Rgb = HULLS[(variant + 1) % len(HULLS)]
    if variant % 3 == 2:
        sail = np.zeros((7, 4, 3))
        for row, up in enumerate(np.linspace(0.0, 1.0, 7)):
            chord = np.linspace(mast_x - 0.05, mast_x - (1.0 - up) * 0.44 * length - 0.1, 4)
            belly = 0.10 * length * (1.0 - up) * np.sin(np.linspace(0.0, np.pi, 4)) + 0.03
            z = boom_z + up * (0.95 * height - boom_z)
            sail[row] = np.column_stack([chord, belly, np.full(4, z)])
        parts.append(loft(sail, (0.95, 0.94, 0.90)))
        jib = np.array(
            [
                [(0.48 * length, 0, free + 0.1)] * 2,
                [(0.30 * length, 0.12, free + 1.0), (mast_x + 0.1, 0.25, free + 0.6)],
                [(mast_x + 0.12, 0.02, 0.8 * height)] * 2,
            ]
        )
        parts.append(loft(jib, (0.93, 0.93, 0.90)))
    else:
        roll = ellipsoid((0.22 * length, 0.13, 0.16), cover)
        parts.append(placed(roll, (-0.12 * length, 0.0, boom_z + 0.14)))
    return [merge(*parts)]


def _pontoonboat(length: float, width: float, height: float, rgb: Rgb, variant: int) -> list[Mesh]:
    parts = []
    for side in (1.0, -1.0):
        tube = ellipsoid((0.5 * length, 0.26, 0.26), (0.66, 0.68, 0.70), 10)
        parts.append(placed(tube, (0.0, side * 0.36 * width, 0.06)))
    parts.append(placed(box((0.92 * length, width, 0.08), (0.55, 0.52, 0.46)), (0, 0, 0.34)))
    fence = box((0.8 * length, 0.04, 0.55), rgb)
    for side in (1.0, -1.0):
        parts.append(placed(fence, (0.0, side * 0.48 * width, 0.66)))
    for x in (-0.3, 0.22):
        for side in (1.0, -1.0):
            parts.append(
                rod(
                    (x * length, side * 0.44 * width, 0.36),
                    (x * length, side * 0.44 * width, height),
                    0.03,
                    (0.8, 0.8, 0.8),
                )
            )
    canopy = box((0.6 * length, width, 0.07), HULLS[(variant + 1) % len(HULLS)])
    parts.append(placed(canopy, (-0.04 * length, 0.0, height)))
    parts.append(placed(box((0.3, 0.3, 0.5), DARK), (-0.48 * length, 0.0, 0.5)))
    crew = [
        placed(person("sitting", 1.25, variant + k), (0.1 - 1.0 * k, 0.35 * (-1.0) ** k, 0.4))
        for k in range(variant % 3)
    ]
    return [merge(*parts), *crew]
