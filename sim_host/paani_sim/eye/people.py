"""People as meshes: facing +x, feet (or the water) at z = 0. Pure numpy."""

from paani_sim.eye.mesh import Mesh, Rgb, box, ellipsoid, merge, placed, rod, turned

POSTURES = ("standing", "walking", "sitting", "swimming", "paddling")
SKIN: tuple[Rgb, ...] = ((0.86, 0.66, 0.53), (0.55, 0.37, 0.26), (0.74, 0.54, 0.40))
HAIR: tuple[Rgb, ...] = ((0.12, 0.08, 0.06), (0.42, 0.28, 0.14), (0.65, 0.60, 0.55))
TOPS: tuple[Rgb, ...] = (
    (0.72, 0.14, 0.13),
    (0.16, 0.27, 0.52),
    (0.90, 0.88, 0.84),
    (0.20, 0.20, 0.22),
    (0.90, 0.55, 0.12),
    (0.22, 0.42, 0.26),
    (0.84, 0.80, 0.22),
)
LEGS: tuple[Rgb, ...] = ((0.15, 0.18, 0.28), (0.24, 0.22, 0.20), (0.52, 0.47, 0.38), (0.30, 0.34, 0.26))
VEST: Rgb = (0.94, 0.38, 0.07)
HATS: tuple[Rgb, ...] = ((0.16, 0.20, 0.34), (0.78, 0.70, 0.52), (0.62, 0.14, 0.13))
SHOE: Rgb = (0.12, 0.11, 0.10)
FOAM: Rgb = (0.66, 0.70, 0.68)
SIDES = (1.0, -1.0)


def person(posture: str, height_m: float, variant: int) -> Mesh:
    """One person in `posture`; `height_m` is what stands above z = 0."""
    skin, hair = SKIN[variant % 3], HAIR[(variant // 2) % 3]
    top, legs = TOPS[variant % len(TOPS)], LEGS[variant % len(LEGS)]
    if posture == "swimming":
        return _swimmer(skin, hair, top, variant)
    if posture in ("sitting", "paddling"):
        return _seated(posture, skin, hair, top, legs, height_m / 0.98, variant)
    walking = posture == "walking"
    stride = 0.26 if walking else 0.03 + 0.02 * (variant % 3)
    scale = height_m / 1.76
    parts = [
        _torso(top, 0.84),
        placed(ellipsoid((0.103, 0.160, 0.12), legs), (0.0, 0.0, 0.84)),
        *_head(skin, hair, 1.60, variant),
    ]
    if variant % 5 == 3:
        parts.append(placed(ellipsoid((0.10, 0.15, 0.24), HATS[(variant + 1) % 3]), (-0.17, 0.0, 1.24)))
    shorts = variant % 4 == 2
    for side in SIDES:
        foot_x = side * stride
        hip = (0.0, 0.09 * side, 0.88)
        knee = (0.5 * foot_x + (0.06 if walking and side < 0 else 0.02), 0.10 * side, 0.47)
        foot = (foot_x, 0.11 * side, 0.07)
        parts += [
            rod(hip, knee, 0.095, legs, 8, end_radius_m=0.068),
            rod(knee, foot, 0.064, skin if shorts else legs, 8, end_radius_m=0.046),
            placed(ellipsoid((0.145, 0.055, 0.055), SHOE), (foot_x + 0.06, 0.115 * side, 0.05)),
        ]
        swing = -1.1 * foot_x if walking else 0.05
        raised = not walking and variant % 3 == 1 and side > 0
        elbow = (0.06 if raised else 0.5 * swing - 0.03, 0.265 * side, 1.12)
        hand = (0.30, 0.14 * side, 1.22) if raised else (swing + 0.06, 0.25 * side, 0.86)
        parts += _arm((0.0, 0.19 * side, 1.41), elbow, hand, top, skin, bare=variant % 2 == 0)
    return placed(merge(*parts), scale=(scale, scale, scale))


Point = tuple[float, float, float]


def _arm(shoulder: Point, elbow: Point, hand: Point, top: Rgb, skin: Rgb, *, bare: bool) -> list[Mesh]:
    """A sleeve, short where `bare`, and a hand."""
    return [
        placed(ellipsoid((0.07, 0.068, 0.075), top), shoulder),
        rod(shoulder, elbow, 0.056, top, 7, end_radius_m=0.044),
        rod(elbow, hand, 0.042, skin if bare else top, 7, end_radius_m=0.032),
        placed(ellipsoid((0.045, 0.034, 0.055), skin), hand),
    ]


def _torso(rgb: Rgb, z_m: float) -> Mesh:
    """Hips to shoulders, `z_m` up."""
    profile = [
        (0.0, 0.0),
        (0.165, 0.0),
        (0.152, 0.14),
        (0.17, 0.30),
        (0.195, 0.44),
        (0.20, 0.53),
        (0.16, 0.60),
        (0.06, 0.65),
    ]
    return placed(turned(profile, rgb, 12), (0.0, 0.0, z_m), scale=(0.64, 1.0, 1.0))


def _head(skin: Rgb, hair: Rgb, z_m: float, variant: int) -> list[Mesh]:
    """Neck, face, hair and perhaps a hat or cap."""
    parts = [
        rod((0.0, 0.0, z_m - 0.22), (0.01, 0.0, z_m - 0.05), 0.055, skin, 8),
        placed(ellipsoid((0.095, 0.078, 0.125), skin, 10), (0.012, 0.0, z_m)),
        placed(ellipsoid((0.022, 0.016, 0.026), skin), (0.105, 0.0, z_m - 0.01)),
        placed(ellipsoid((0.100, 0.088, 0.105), hair, 10), (-0.022, 0.0, z_m + 0.04)),
    ]
    for side in SIDES:
        parts.append(placed(ellipsoid((0.012, 0.016, 0.012), (0.08, 0.06, 0.05)), (0.092, 0.032 * side, z_m + 0.025)))
    if variant % 3 == 0:
        hat = HATS[variant % len(HATS)]
        parts.append(placed(ellipsoid((0.11, 0.098, 0.075), hat, 10), (-0.01, 0.0, z_m + 0.085)))
        brim = (0.15, 0.14, 0.014) if variant % 2 else (0.09, 0.075, 0.012)
        parts.append(placed(ellipsoid(brim, hat), (0.0 if variant % 2 else 0.09, 0.0, z_m + 0.075)))
    elif variant % 3 == 1:
        parts.append(placed(ellipsoid((0.045, 0.085, 0.15), hair), (-0.075, 0.0, z_m - 0.07)))
    return parts


def _seated(posture: str, skin: Rgb, hair: Rgb, top: Rgb, legs: Rgb, scale: float, variant: int) -> Mesh:
    parts = [
        _torso(top, 0.05),
        *_head(skin, hair, 0.82, variant),
    ]
    if posture == "paddling":
        parts.append(placed(_torso(VEST, 0.0), (0.0, 0.0, 0.16), scale=(1.22, 1.06, 0.78)))
    for side in SIDES:
        knee = (0.44, 0.12 * side, 0.22)
        parts += [
            rod((0.0, 0.09 * side, 0.10), knee, 0.09, legs, 8, end_radius_m=0.066),
            rod(knee, (0.52, 0.12 * side, -0.12), 0.06, legs, 8, end_radius_m=0.045),
            placed(ellipsoid((0.13, 0.05, 0.05), SHOE), (0.56, 0.12 * side, -0.14)),
        ]
        hand = (0.38, (0.30 if posture == "paddling" else 0.10) * side, 0.34)
        parts += _arm((0.0, 0.19 * side, 0.61), (0.16, 0.27 * side, 0.38), hand, top, skin, bare=variant % 2 == 0)
    if posture == "paddling":
        parts.append(rod((0.40, 1.0, 0.05), (0.36, -1.0, 0.62), 0.02, (0.15, 0.15, 0.15)))
        parts.append(placed(box((0.03, 0.34, 0.16), (0.95, 0.85, 0.2)), (0.40, 1.0, 0.05)))
        parts.append(placed(box((0.03, 0.34, 0.16), (0.95, 0.85, 0.2)), (0.36, -1.0, 0.62)))
    return placed(merge(*parts), scale=(scale, scale, scale))


def _swimmer(skin: Rgb, hair: Rgb, top: Rgb, variant: int) -> Mesh:
    """Head and shoulders above the water, the back awash; crawling, or treading water with arms spread."""
    head = [placed(part, (0.20, 0.0, -1.43)) for part in _head(skin, hair, 1.60, variant | 1)]
    parts = [
        placed(ellipsoid((0.20, 0.22, 0.10), skin if variant % 2 else top), (0.0, 0.0, -0.02)),
        placed(ellipsoid((0.30, 0.16, 0.09), top), (-0.34, 0.0, -0.065)),
        *head,
    ]
    if variant % 3 == 0:
        for side in SIDES:
            parts += [
                rod((0.04, 0.18 * side, 0.02), (0.26, 0.46 * side, -0.02), 0.05, skin, 7),
                placed(ellipsoid((0.07, 0.05, 0.008), FOAM), (0.30, 0.48 * side, 0.004)),
            ]
    else:
        parts += [
            rod((0.04, 0.19, 0.04), (0.52, 0.27, -0.02), 0.048, skin, 7, end_radius_m=0.036),
            rod((0.0, -0.20, 0.04), (0.10, -0.40, 0.24), 0.05, skin, 7),
            rod((0.10, -0.40, 0.24), (0.46, -0.33, 0.05), 0.044, skin, 7, end_radius_m=0.034),
            placed(ellipsoid((0.09, 0.06, 0.010), FOAM), (0.52, -0.31, 0.005)),
            placed(ellipsoid((0.10, 0.07, 0.02), FOAM), (-0.78, 0.05, 0.0)),
        ]
    return merge(*parts)
