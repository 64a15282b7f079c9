"""Buoys, piers and the bridge as meshes: centred on the origin, water at z = 0."""

import numpy as np

from paani_sim.eye.mesh import (
    ROCK,
    STONE,
    WOOD,
    Mesh,
    Rgb,
    box,
    loft,
    merge,
    placed,
    rod,
    turned,
)

BUOY_RGB: tuple[Rgb, ...] = (
    (0.80, 0.09, 0.07),
    (0.06, 0.45, 0.20),
    (0.95, 0.78, 0.08),
    (0.97, 0.42, 0.05),
    (0.92, 0.92, 0.90),
    (0.10, 0.10, 0.11),
)
BUOY_LOOKS = ("can", "cone", "sphere", "pillar", "spar")
PIER_LOOKS = ("jetty", "pontoon", "quay", "quay_steps", "finger")
TIMBER: Rgb = (0.47, 0.39, 0.30)
CONCRETE: Rgb = (0.62, 0.61, 0.58)
STEEL: Rgb = (0.30, 0.32, 0.34)
PARAPET: Rgb = (0.62, 0.58, 0.52)
ABUTMENT_M = 0.9  # an abutment reaches this far beyond the arch
DECK_M, HALF_DECK_M = 0.5, 0.25  # of a bridge: middle of the deck above the soffit, and half its thickness
RAMP_SLOPE, RAMP_FOOT_M = 0.2, 0.5  # a ramp ends below every bank


def buoy(look: str, width_m: float, height_m: float, variant: int) -> Mesh:
    """A buoy; every second round of the colours it wears a white band."""
    rgb = BUOY_RGB[variant % len(BUOY_RGB)]
    banded = variant >= len(BUOY_RGB)
    band = (0.93, 0.93, 0.91) if banded else rgb
    r, h = 0.5 * width_m, height_m
    if look == "sphere":
        angle = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 11)
        profile = [(r * float(np.cos(a)), 0.3 * h + r * float(np.sin(a))) for a in angle]
        rows = [band if 5 <= k <= 7 else rgb for k in range(11)]
        eye = rod((0, 0, 0.3 * h + 0.95 * r), (0, 0, 0.3 * h + r + 0.12), 0.04, STEEL)
        return merge(turned(profile, rows, 14), eye)
    if look == "can":
        profile = [
            (r, -0.3),
            (r, 0.35 * h),
            (r, 0.35 * h),
            (r, 0.7 * h),
            (r, 0.7 * h),
            (r, h),
            (0.0, h + 0.02),
        ]
        return turned(profile, [rgb, rgb, band, band, rgb, rgb, rgb], 14)
    if look == "cone":
        profile = [
            (r, -0.3),
            (r, 0.25 * h),
            (r, 0.25 * h),
            (0.55 * r, 0.62 * h),
            (0.55 * r, 0.62 * h),
            (0.04, h),
        ]
        return turned(profile, [rgb, rgb, band, band, rgb, rgb], 14)
    if look == "spar":
        profile = [
            (0.35 * r, -0.3),
            (0.35 * r, 0.5 * h),
            (0.35 * r, 0.5 * h),
            (0.30 * r, 0.72 * h),
            (0.30 * r, 0.72 * h),
            (0.28 * r, h),
            (0.0, h),
        ]
        return turned(profile, [rgb, rgb, band, band, rgb, rgb, rgb], 8)
    base = turned([(r, -0.3), (r, 0.16 * h), (0.85 * r, 0.24 * h), (0.2 * r, 0.26 * h)], rgb, 14)
    legs = [
        rod(
            (0.55 * r * cx, 0.55 * r * cy, 0.24 * h),
            (0.2 * r * cx, 0.2 * r * cy, 0.78 * h),
            0.06 * r + 0.015,
            rgb,
        )
        for cx, cy in ((1, 1), (1, -1), (-1, 1), (-1, -1))
    ]
    panel = turned([(0.30 * r, 0.45 * h), (0.26 * r, 0.74 * h)], band, 8)
    top = turned([(0.0, 0.78 * h), (0.34 * r, 0.80 * h), (0.05, h)], rgb, 10)
    return merge(base, *legs, panel, top)


def pier(look: str, length_m: float, width_m: float, height_m: float, variant: int) -> Mesh:
    """A pier along x, its head toward +x."""
    build = {"jetty": _jetty, "pontoon": _pontoon, "quay": _quay, "quay_steps": _steps, "finger": _finger}[look]
    return build(length_m, width_m, height_m, variant)


def _jetty(length: float, width: float, height: float, variant: int) -> Mesh:
    tone = 1.0 - 0.12 * (variant % 3)
    rgb: Rgb = (TIMBER[0] * tone, TIMBER[1] * tone, TIMBER[2] * tone)
    deck = box((length, width, 0.10), (rgb[0] * 1.15, rgb[1] * 1.15, rgb[2] * 1.12), WOOD)
    parts = [placed(deck, (0.0, 0.0, height - 0.05))]
    count = max(2, round(length / 1.9))
    for x in np.linspace(-0.5 * length + 0.15, 0.5 * length - 0.15, count):
        for side in (1.0, -1.0):
            y = side * (0.5 * width - 0.06)
            parts.append(
                rod(
                    (float(x), y, -0.9),
                    (float(x), y, height + 0.25),
                    0.10,
                    (0.30, 0.24, 0.18),
                    7,
                    material=WOOD,
                )
            )
        beam = box((0.12, width, 0.16), (0.28, 0.23, 0.17), WOOD)
        parts.append(placed(beam, (float(x), 0.0, height - 0.18)))
    if variant % 2 == 1:
        for x in np.linspace(-0.5 * length + 0.15, 0.5 * length - 0.15, count):
            y = 0.5 * width - 0.08
            parts.append(rod((float(x), y, height), (float(x), y, height + 0.95), 0.05, rgb))
        for z in (0.5, 0.92):
            rail = box((length, 0.05, 0.09), rgb, WOOD)
            parts.append(placed(rail, (0.0, 0.5 * width - 0.08, height + z)))
    else:
        for k in (0.35, 0.46):
            parts.append(
                rod(
                    (k * length, -0.4 * width, height),
                    (k * length, -0.4 * width, height + 0.42),
                    0.09,
                    STEEL,
                    8,
                )
            )
    return merge(*parts)


def _pontoon(length: float, width: float, height: float, variant: int) -> Mesh:
    grey: Rgb = (0.66, 0.65, 0.62)
    parts = [
        placed(box((length, width, 0.10), (0.58, 0.52, 0.44), WOOD), (0.0, 0.0, height - 0.05)),
        placed(
            box((0.98 * length, 0.94 * width, height), (0.34, 0.35, 0.36), ROCK),
            (0.0, 0.0, 0.5 * height - 0.12),
        ),
    ]
    for x in (-0.45, 0.0, 0.45):
        pile = rod(
            (x * length, 0.5 * width, -0.8),
            (x * length, 0.5 * width, height + 1.5),
            0.13,
            (0.38, 0.36, 0.33),
            8,
        )
        parts.append(pile)
        cleat = box((0.3, 0.08, 0.12), grey)
        parts.append(placed(cleat, ((x + 0.03) * length, -0.45 * width, height + 0.06)))
    if variant % 2 == 1:
        locker = box((1.1, 0.5, 0.5), (0.85, 0.85, 0.82))
        parts.append(placed(locker, (-0.25 * length, 0.3 * width, height + 0.25)))
    return merge(*parts)


def _quay(length: float, width: float, height: float, variant: int) -> Mesh:
    wall = box((length, width, height + 0.8), CONCRETE, ROCK)
    cap = box((length, width + 0.12, 0.16), (0.72, 0.71, 0.68), ROCK)
    parts = [placed(wall, (0, 0, 0.5 * height - 0.4)), placed(cap, (0, 0, height))]
    for x in np.linspace(-0.42, 0.42, 4):
        parts.append(
            rod(
                (x * length, 0.3 * width, height),
                (x * length, 0.3 * width, height + 0.4),
                0.12,
                STEEL,
                8,
            )
        )
        fender = box((0.18, width + 0.3, 0.9), (0.08, 0.08, 0.08))
        parts.append(placed(fender, (float(x) * length, 0.0, 0.5 * height)))
    return merge(*parts)


def _steps(length: float, width: float, height: float, variant: int) -> Mesh:
    """Stone steps from the top, at -x, down into the water at +x, between low walls."""
    tone = 1.0 - 0.1 * (variant % 3)
    stone: Rgb = (0.60 * tone, 0.57 * tone, 0.51 * tone)
    count = max(3, round((height + 0.3) / 0.20))
    going = length / count
    parts = []
    for k in range(count):
        top = height - k * (height + 0.3) / count
        tread = box((going + 0.02, width, top + 0.8), stone, STONE)
        parts.append(placed(tread, (-0.5 * length + (k + 0.5) * going, 0.0, 0.5 * (top - 0.8))))
    for side in (1.0, -1.0):
        y = side * (0.5 * width - 0.12)
        post_z = height + 0.9
        rail = rod((-0.5 * length, y, post_z), (0.5 * length, y, 0.9), 0.035, STEEL)
        parts += [rail, *(rod((x * length, y, -0.3), (x * length, y, z), 0.035, STEEL) for x, z in _rail_posts(post_z))]
    return merge(*parts)


def _rail_posts(top_m: float) -> tuple[tuple[float, float], ...]:
    """Where along the steps posts stand, and how high their rail is there."""
    return tuple((x, 0.9 + (0.5 - x) * (top_m - 0.9)) for x in (-0.48, 0.0, 0.48))


def _finger(length: float, width: float, height: float, variant: int) -> Mesh:
    """A narrow floating finger: grey deck, floats under it, fendered edge, cleats, a pile at its head."""
    deck: Rgb = (0.64, 0.62, 0.58) if variant % 2 == 0 else (0.52, 0.45, 0.36)
    parts = [
        placed(box((length, width, 0.12), deck, WOOD), (0.0, 0.0, height - 0.06)),
        placed(box((length + 0.04, width + 0.10, 0.10), (0.10, 0.10, 0.11)), (0.0, 0.0, height - 0.16)),
    ]
    for x in np.linspace(-0.42, 0.42, max(2, round(length / 2.5))):
        float_ = box((1.0, 0.9 * width, height + 0.1), (0.22, 0.26, 0.34))
        parts.append(placed(float_, (float(x) * length, 0.0, 0.5 * height - 0.2)))
        for side in (1.0, -1.0):
            cleat = box((0.24, 0.06, 0.09), STEEL)
            parts.append(placed(cleat, (float(x) * length, side * 0.42 * width, height + 0.04)))
    pile = rod((0.5 * length - 0.2, 0.0, -0.8), (0.5 * length - 0.2, 0.0, height + 1.6), 0.11, STEEL, 8)
    cap = rod(
        (0.5 * length - 0.2, 0.0, height + 1.55), (0.5 * length - 0.2, 0.0, height + 1.75), 0.13, (0.9, 0.9, 0.88), 8
    )
    return merge(*parts, pile, cap)


def bridge(length_m: float, width_m: float, base_z_m: float, height_m: float) -> Mesh:
    """A road bridge along x with a flat arch below, abutments on both banks and ramps down from them."""
    deck_z = base_z_m + DECK_M
    stone: Rgb = (0.56, 0.52, 0.46)
    x = np.linspace(-0.5 * length_m, 0.5 * length_m, 21)
    crown = deck_z - 0.35
    arch = crown - (crown - 0.9) * (np.abs(x) / (0.5 * length_m)) ** 2.4
    road_m = length_m + 2.0 * ABUTMENT_M
    parts = [placed(box((road_m, width_m, 2.0 * HALF_DECK_M), stone, ROCK), (0.0, 0.0, deck_z))]
    for side in (1.0, -1.0):
        y = np.full(21, side * 0.5 * width_m)
        top, low = np.column_stack([x, y, np.full(21, deck_z)]), np.column_stack([x, y, arch])
        parts.append(loft(np.stack([top, low] if side > 0 else [low, top]), stone, ROCK))
        wall = box((road_m, 0.30, 0.95), PARAPET, ROCK)
        parts.append(placed(wall, (0.0, side * (0.5 * width_m - 0.15), deck_z + 0.6)))
    under = [np.column_stack([x, np.full(21, s * 0.5 * width_m), arch]) for s in (-1.0, 1.0)]
    parts.append(loft(np.stack(under), (0.30, 0.28, 0.25), ROCK))
    for side in (1.0, -1.0):
        block = box((3.0, width_m + 0.6, deck_z + 1.5), stone, ROCK)
        parts.append(placed(block, (side * (0.5 * road_m - 1.5), 0.0, 0.5 * deck_z - 0.75)))
    parts.append(placed(box((length_m, 0.05, 0.05), STEEL), (0, 0, base_z_m + height_m)))
    ramp = placed(_ramp(width_m, deck_z + HALF_DECK_M, stone), (0.5 * road_m, 0.0, 0.0))
    return merge(*parts, ramp, placed(ramp, yaw_rad=np.pi))


def _ramp(width_m: float, top_m: float, stone: Rgb) -> Mesh:
    """A road between walls, from `top_m` at the origin down along +x until it is in the ground."""
    run_m, deep_m = _ramp_m(top_m), 2.5
    pitch = float(np.arctan(RAMP_SLOPE))
    slope_m, up = run_m / np.cos(pitch), np.array([np.sin(pitch), 0.0, np.cos(pitch)])
    middle = np.array([0.5 * run_m, 0.0, top_m - 0.5 * run_m * RAMP_SLOPE])
    road = middle - 0.5 * deep_m * up
    parts = [placed(box((slope_m, width_m, deep_m), stone, ROCK), (road[0], 0.0, road[2]), pitch_rad=pitch)]
    wall = middle + 0.35 * up
    for side in (1.0, -1.0):
        at = (wall[0], side * (0.5 * width_m - 0.15), wall[2])
        parts.append(placed(box((slope_m, 0.30, 0.95), PARAPET, ROCK), at, pitch_rad=pitch))
    return merge(*parts)


def bridge_reach_m(length_m: float, base_z_m: float) -> float:
    """From the middle of a bridge to where its road is in the ground."""
    return 0.5 * length_m + ABUTMENT_M + _ramp_m(base_z_m + DECK_M + HALF_DECK_M)


def _ramp_m(top_m: float) -> float:
    return (top_m - RAMP_FOOT_M) / RAMP_SLOPE
