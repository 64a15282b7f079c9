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
LEGS: tuple[Rgb, ...] = ((0.15, 0.18, 0.28), (0.24, 0.22, 0.20), (0.52, 0.47, 0.38))


def person(posture: str, height_m: float, variant: int) -> Mesh:
    """One person in `posture`; `height_m` is what stands above z = 0."""
    skin, hair = SKIN[variant % 3], HAIR[(variant // 2) % 3]
    top, legs = TOPS[variant % len(TOPS)], LEGS[variant % len(LEGS)]
    if posture == "swimming":
        return _swimmer(skin, hair, top)
    if posture in ("sitting", "paddling"):
        return _seated(posture, skin, hair, top, legs, height_m / 0.98)
    stride = 0.24 if posture == "walking" else 0.04
    scale = height_m / 1.76
    parts = [
        _torso(top, 0.84),
        placed(ellipsoid((0.12, 0.165, 0.14), legs), (0.0, 0.0, 0.88)),
        *_head(skin, hair, 1.60),
    ]
    for side in (1.0, -1.0):
        foot_x = side * stride
        hip, knee = (0.0, 0.09 * side, 0.86), (0.5 * foot_x + 0.03, 0.10 * side, 0.46)
        foot = (foot_x, 0.11 * side, 0.04)
        parts += [
            rod(hip, knee, 0.085, legs, end_radius_m=0.062),
            rod(knee, foot, 0.062, legs, end_radius_m=0.045),
            placed(box((0.25, 0.09, 0.08), (0.12, 0.11, 0.10)), (foot_x + 0.06, 0.11 * side, 0.04)),
        ]
        hand = (-0.9 * foot_x + 0.08, 0.27 * side, 0.84)
        elbow = (-0.5 * foot_x, 0.26 * side, 1.10)
        parts += [
            rod((0.0, 0.19 * side, 1.40), elbow, 0.052, top, end_radius_m=0.042),
            rod(elbow, hand, 0.038, skin, end_radius_m=0.032),
        ]
    return placed(merge(*parts), scale=(scale, scale, scale))


def _torso(rgb: Rgb, z_m: float) -> Mesh:
    """Hips to shoulders, `z_m` up."""
    profile = [(0.0, 0.0), (0.155, 0.0), (0.15, 0.16), (0.185, 0.40), (0.20, 0.53), (0.17, 0.60), (0.06, 0.65)]
    return placed(turned(profile, rgb, 10), (0.0, 0.0, z_m), scale=(0.62, 1.0, 1.0))


def _head(skin: Rgb, hair: Rgb, z_m: float) -> list[Mesh]:
    return [
        rod((0.0, 0.0, z_m - 0.22), (0.0, 0.0, z_m - 0.05), 0.055, skin),
        placed(ellipsoid((0.10, 0.082, 0.125), skin), (0.0, 0.0, z_m)),
        placed(ellipsoid((0.105, 0.092, 0.10), hair), (-0.018, 0.0, z_m + 0.045)),
    ]


def _seated(posture: str, skin: Rgb, hair: Rgb, top: Rgb, legs: Rgb, scale: float) -> Mesh:
    parts = [
        _torso(top, 0.05),
        *_head(skin, hair, 0.82),
    ]
    for side in (1.0, -1.0):
        knee = (0.44, 0.12 * side, 0.22)
        parts += [
            rod((0.0, 0.09 * side, 0.10), knee, 0.085, legs, end_radius_m=0.065),
            rod(knee, (0.52, 0.12 * side, -0.12), 0.06, legs, end_radius_m=0.045),
        ]
        hand = (0.38, (0.30 if posture == "paddling" else 0.10) * side, 0.34)
        parts += [
            rod((0.0, 0.19 * side, 0.60), (0.16, 0.27 * side, 0.38), 0.05, top),
            rod((0.16, 0.27 * side, 0.38), hand, 0.042, skin),
        ]
    if posture == "paddling":
        parts.append(rod((0.40, 1.0, 0.05), (0.36, -1.0, 0.62), 0.02, (0.15, 0.15, 0.15)))
        parts.append(placed(box((0.03, 0.34, 0.16), (0.95, 0.85, 0.2)), (0.40, 1.0, 0.05)))
        parts.append(placed(box((0.03, 0.34, 0.16), (0.95, 0.85, 0.2)), (0.36, -1.0, 0.62)))
    return placed(merge(*parts), scale=(scale, scale, scale))


def _swimmer(skin: Rgb, hair: Rgb, top: Rgb) -> Mesh:
    return merge(
        placed(ellipsoid((0.34, 0.21, 0.12), top), (-0.22, 0.0, 0.03)),
        *(placed(part, (0.12, 0.0, -1.36)) for part in _head(skin, hair, 1.60)),
        rod((0.0, 0.20, 0.08), (0.48, 0.30, 0.02), 0.05, skin),
        rod((0.0, -0.20, 0.08), (0.22, -0.42, 0.16), 0.05, skin),
        rod((0.22, -0.42, 0.16), (0.55, -0.30, 0.04), 0.045, skin),
    )
