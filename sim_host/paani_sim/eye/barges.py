"""Boats that work or carry a house: bow along +x, waterline at z = 0, centred on the origin. Pure numpy."""

from paani_sim.eye.hull import DARK, HULLS, hull
from paani_sim.eye.mesh import GLASS, Mesh, Rgb, box, ellipsoid, merge, placed, rod
from paani_sim.eye.people import person


def workboat(length: float, width: float, height: float, rgb: Rgb, variant: int) -> list[Mesh]:
    free = 0.32 * height
    parts = [
        hull(
            length,
            width,
            free,
            rgb,
            stripe=DARK,
            stern=0.92,
            bow_power=3.0,
            deck=(0.46, 0.47, 0.44),
        )
    ]
    house_h = height - free
    house = box((0.24 * length, 0.62 * width, house_h), (0.90, 0.88, 0.80))
    glass = box((0.245 * length, 0.63 * width, 0.32 * house_h), (0.09, 0.11, 0.13), GLASS)
    roof = box((0.30 * length, 0.72 * width, 0.08), (0.80, 0.30, 0.12))
    x = 0.12 * length
    parts += [
        placed(house, (x, 0.0, free + 0.5 * house_h)),
        placed(glass, (x, 0.0, free + 0.70 * house_h)),
        placed(roof, (x, 0.0, free + house_h)),
        rod((x, 0, height), (x, 0, height + 1.3), 0.04, DARK),
    ]
    for k in range(4):
        for side in (1.0, -1.0):
            tyre = placed(
                ellipsoid((0.24, 0.10, 0.24), (0.06, 0.06, 0.06)),
                ((-0.36 + 0.2 * k) * length, side * 0.5 * width, 0.6 * free),
            )
            parts.append(tyre)
    parts.append(
        placed(
            box((0.16 * length, 0.4 * width, 0.5), (0.30, 0.42, 0.30)),
            (-0.28 * length, 0.0, free + 0.25),
        )
    )
    return [merge(*parts)]


def barge(length: float, width: float, height: float, rgb: Rgb, variant: int) -> list[Mesh]:
    free = 0.34 * height
    hull_rgb: Rgb = DARK if variant % 2 == 0 else rgb
    parts = [
        hull(
            length,
            width,
            free,
            hull_rgb,
            stripe=(0.75, 0.62, 0.25),
            stern=0.9,
            bow_power=5.0,
            deck=(0.30, 0.30, 0.32),
        )
    ]
    house_l, house_h = 0.66 * length, height - free
    sides = HULLS[(variant + 4) % len(HULLS)]
    cabin = box((house_l, 0.78 * width, house_h), sides)
    roof = box((house_l + 0.3, 0.84 * width, 0.06), (0.62, 0.60, 0.55))
    parts += [
        placed(cabin, (-0.06 * length, 0.0, free + 0.5 * house_h)),
        placed(roof, (-0.06 * length, 0.0, free + house_h)),
    ]
    for k in range(6):
        pane = box((0.07 * house_l, 0.79 * width, 0.36 * house_h), (0.10, 0.12, 0.13), GLASS)
        x = -0.06 * length + (k - 2.5) * 0.15 * house_l
        parts.append(placed(pane, (x, 0.0, free + 0.58 * house_h)))
    for k in range(3):
        pot = ellipsoid((0.3, 0.3, 0.22), (0.25, 0.38, 0.15))
        parts.append(placed(pot, ((-0.2 + 0.14 * k) * length, 0.2, height + 0.12)))
    return [merge(*parts)]


def narrowboat(length: float, width: float, height: float, rgb: Rgb, variant: int) -> list[Mesh]:
    """Long and low: black steel hull, a painted cabin with portholes, a well deck at the bow, a tiller aft."""
    free = 0.40 * height
    livery: tuple[Rgb, ...] = ((0.12, 0.28, 0.18), (0.42, 0.09, 0.10), (0.11, 0.17, 0.36), (0.16, 0.16, 0.17))
    cream: Rgb = (0.84, 0.76, 0.55)
    paint = livery[variant % len(livery)]
    parts = [hull(length, width, free, DARK, stripe=paint, stern=0.92, bow_power=7.0, deck=(0.42, 0.34, 0.26))]
    cabin_l, wall = 0.72 * length, height - free
    x = -0.05 * length
    parts.append(placed(box((cabin_l, 0.80 * width, wall), paint), (x, 0.0, free + 0.5 * wall)))
    panel = box((0.94 * cabin_l, 0.81 * width, 0.5 * wall), cream if variant % 3 == 0 else HULLS[variant % len(HULLS)])
    parts.append(placed(panel, (x, 0.0, free + 0.45 * wall)))
    parts.append(placed(box((cabin_l + 0.1, 0.84 * width, 0.07), (0.34, 0.36, 0.36)), (x, 0.0, height)))
    count = max(3, round(cabin_l / 1.8))
    for k in range(count):
        at = x + ((k + 0.5) / count - 0.5) * 0.9 * cabin_l
        pane = placed(ellipsoid((0.19, 0.42 * width, 0.19), (0.08, 0.09, 0.10)), (at, 0.0, free + 0.5 * wall))
        parts.append(pane)
    for k in range(3):
        pot = ellipsoid((0.22, 0.16, 0.16), ((0.66, 0.16, 0.14), (0.22, 0.40, 0.18), (0.80, 0.66, 0.20))[k])
        parts.append(placed(pot, (x + (0.28 - 0.2 * k) * cabin_l, 0.12, height + 0.12)))
    parts.append(rod((x - 0.2 * cabin_l, -0.2, height), (x - 0.2 * cabin_l, -0.2, height + 0.5), 0.07, DARK))
    tiller = ((-0.47 * length, 0.0, free), (-0.44 * length, 0.0, free + 0.85), (-0.37 * length, 0.0, free + 0.95))
    parts += [rod(tiller[0], tiller[1], 0.03, (0.7, 0.55, 0.2)), rod(tiller[1], tiller[2], 0.03, (0.6, 0.2, 0.15))]
    crew = []
    if variant % 2 == 1:
        crew = [placed(person("standing", 1.72, variant), (-0.42 * length, 0.25, 0.72 * free))]
    return [merge(*parts), *crew]


def tug(length: float, width: float, height: float, rgb: Rgb, variant: int) -> list[Mesh]:
    """High bow, low stern hung with tyres, a wheelhouse, a funnel and a mast."""
    free = 0.24 * height
    hull_rgb: Rgb = DARK if variant % 2 == 0 else rgb
    deck: Rgb = (0.30, 0.36, 0.32)
    parts = [hull(length, width, free, hull_rgb, stripe=(0.72, 0.16, 0.10), stern=0.88, bow_power=3.2, deck=deck)]
    fore = box((0.34 * length, 0.60 * width, 0.26 * height), (0.88, 0.86, 0.80))
    parts.append(placed(fore, (0.06 * length, 0.0, free + 0.15 * height)))
    house_h = 0.30 * height
    house_z = free + 0.28 * height
    parts.append(
        placed(
            box((0.20 * length, 0.50 * width, house_h), (0.92, 0.90, 0.84)), (0.08 * length, 0, house_z + 0.5 * house_h)
        )
    )
    glass = box((0.205 * length, 0.51 * width, 0.36 * house_h), (0.08, 0.10, 0.12), GLASS)
    parts.append(placed(glass, (0.08 * length, 0.0, house_z + 0.66 * house_h)))
    parts.append(
        placed(box((0.24 * length, 0.58 * width, 0.08), (0.70, 0.18, 0.12)), (0.08 * length, 0, house_z + house_h))
    )
    funnel_x, funnel_top = -0.10 * length, free + 0.62 * height
    band = HULLS[(variant + 2) % len(HULLS)]
    parts.append(rod((funnel_x, 0, free), (funnel_x, 0, funnel_top), 0.11 * width, band, 10))
    parts.append(rod((funnel_x, 0, 0.92 * funnel_top), (funnel_x, 0, funnel_top + 0.1), 0.115 * width, DARK, 10))
    parts.append(rod((0.04 * length, 0, house_z + house_h), (0.04 * length, 0, height), 0.06, (0.85, 0.80, 0.60)))
    parts.append(rod((-0.22 * length, -0.2, free), (-0.22 * length, -0.2, free + 0.7), 0.18, DARK, 8))
    for k in range(6):
        for side in (1.0, -1.0):
            reach = 0.5 * width * (1.0 if k < 4 else 0.88 if k == 4 else 0.62)
            tyre = ellipsoid((0.36, 0.14, 0.36), (0.06, 0.06, 0.06))
            parts.append(placed(tyre, ((-0.42 + 0.15 * k) * length, side * reach, (0.62 + 0.09 * k) * free)))
    bow = ellipsoid((0.25, 0.22 * width, 0.3), (0.07, 0.07, 0.07))
    parts.append(placed(bow, (0.49 * length, 0.0, 1.18 * free)))
    crew = [placed(person("standing", 1.75, variant), (-0.3 * length, 0.3, free))] if variant % 3 == 1 else []
    return [merge(*parts), *crew]
