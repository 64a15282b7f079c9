"""Triangle meshes with colour per vertex, and the few shapes everything is made of. Pure numpy.

Colours are display values in 0..1. A material number selects the surface detail in the shader.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from paani.arrays import F32

Rgb = tuple[float, float, float]

PAINT, LAND, WOOD, ROCK, GLASS, FACADE, BRICK, STONE, PAVING = range(9)


@dataclass(frozen=True, eq=False)
class Mesh:
    """`vertices` `(n, 10)`: position, normal, rgb, material. `triangles` `(m, 3)` indices."""

    vertices: F32
    triangles: npt.NDArray[np.uint32]


def mesh(
    points: npt.ArrayLike,
    normals: npt.ArrayLike,
    triangles: npt.ArrayLike,
    rgb: npt.ArrayLike,
    material: int = PAINT,
) -> Mesh:
    """Assemble a mesh; `rgb` is one colour or one per vertex."""
    position = np.asarray(points, np.float32).reshape(-1, 3)
    vertices = np.empty((len(position), 10), np.float32)
    vertices[:, 0:3] = position
    vertices[:, 3:6] = normals
    vertices[:, 6:9] = rgb
    vertices[:, 9] = material
    return Mesh(vertices, np.asarray(triangles, np.uint32).reshape(-1, 3))


def merge(*parts: Mesh) -> Mesh:
    """All parts as one mesh."""
    offsets = np.cumsum([0] + [len(p.vertices) for p in parts[:-1]])
    return Mesh(
        np.concatenate([p.vertices for p in parts]),
        np.concatenate([p.triangles + np.uint32(o) for p, o in zip(parts, offsets, strict=True)]),
    )


def placed(
    part: Mesh,
    move_m: tuple[float, float, float] = (0.0, 0.0, 0.0),
    *,
    yaw_rad: float = 0.0,
    pitch_rad: float = 0.0,
    roll_rad: float = 0.0,
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0),
) -> Mesh:
    """The part scaled, turned (roll, then pitch, then yaw) and moved."""
    turn = rotation(roll_rad, pitch_rad, yaw_rad).astype(np.float32)
    size = np.asarray(scale, np.float32)
    vertices = part.vertices.copy()
    vertices[:, 0:3] = (part.vertices[:, 0:3] * size) @ turn.T + np.asarray(move_m, np.float32)
    normal = (part.vertices[:, 3:6] / size) @ turn.T
    vertices[:, 3:6] = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-6)
    return Mesh(vertices, part.triangles)


def rotation(roll_rad: float, pitch_rad: float, yaw_rad: float) -> npt.NDArray[np.float64]:
    """Body to map: yaw about z, then pitch about y (bow down positive), then roll about x."""
    cr, sr, cp, sp = np.cos(roll_rad), np.sin(roll_rad), np.cos(pitch_rad), np.sin(pitch_rad)
    cy, sy = np.cos(yaw_rad), np.sin(yaw_rad)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def box(size_m: tuple[float, float, float], rgb: Rgb, material: int = PAINT) -> Mesh:
    """A box centred on the origin."""
    half = 0.5 * np.asarray(size_m)
    points: list[npt.NDArray[np.float64]] = []
    normals: list[npt.NDArray[np.float64]] = []
    triangles: list[tuple[int, int, int]] = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            normal = np.zeros(3)
            normal[axis] = sign
            u, v = np.roll(np.eye(3), axis + 1, axis=1)[0], np.roll(np.eye(3), axis + 2, axis=1)[0]
            first = len(points)
            points += [(normal + a * u + b * v) * half for a, b in _SQUARE]
            normals += [normal] * 4
            triangles += [(first, first + 1, first + 2), (first, first + 2, first + 3)]
    return mesh(points, normals, triangles, rgb, material)


_SQUARE = ((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0))


def turned(profile: list[tuple[float, float]], rgb: npt.ArrayLike, sides: int = 10, material: int = PAINT) -> Mesh:
    """A solid of revolution about z; `profile` holds `(radius_m, z_m)` from the bottom up.

    `rgb` is one colour, or one per profile point (hard edges need repeated points).
    """
    radius, height = np.asarray(profile, float).T
    around = np.linspace(0.0, 2.0 * np.pi, sides + 1)
    circle = np.column_stack([np.cos(around), np.sin(around)])
    points = np.concatenate(
        [
            radius[:, None, None] * circle[None],
            np.broadcast_to(height[:, None, None], (len(radius), sides + 1, 1)),
        ],
        axis=2,
    )
    slope = np.column_stack([np.gradient(height), -np.gradient(radius)])
    slope /= np.maximum(np.linalg.norm(slope, axis=1, keepdims=True), 1e-9)
    normals = np.concatenate(
        [
            slope[:, None, :1] * circle[None],
            np.broadcast_to(slope[:, None, 1:], (len(radius), sides + 1, 1)),
        ],
        axis=2,
    )
    colours = np.broadcast_to(np.asarray(rgb, float).reshape(-1, 1, 3), points.shape)
    return mesh(
        points.reshape(-1, 3),
        normals.reshape(-1, 3),
        grid_triangles(len(radius), sides + 1),
        colours.reshape(-1, 3),
        material,
    )


def rod(
    start: tuple[float, float, float],
    end: tuple[float, float, float],
    radius_m: float,
    rgb: Rgb,
    sides: int = 6,
    end_radius_m: float | None = None,
    material: int = PAINT,
) -> Mesh:
    """A (tapering) round bar between two points."""
    a, b = np.asarray(start, float), np.asarray(end, float)
    along = b - a
    length_m = float(np.linalg.norm(along))
    tip_m = radius_m if end_radius_m is None else end_radius_m
    bar = turned([(0.0, 0.0), (radius_m, 0.0), (tip_m, length_m), (0.0, length_m)], rgb, sides, material)
    pitch = float(np.arctan2(np.hypot(along[0], along[1]), along[2]))
    yaw = float(np.arctan2(along[1], along[0]))
    return placed(bar, start, yaw_rad=yaw, pitch_rad=pitch)


def ellipsoid(radii_m: tuple[float, float, float], rgb: Rgb, sides: int = 8) -> Mesh:
    """An ellipsoid centred on the origin."""
    angle = np.linspace(-0.5 * np.pi, 0.5 * np.pi, max(5, sides * 2 // 3))
    ball = turned([(float(np.cos(a)), float(np.sin(a))) for a in angle], rgb, sides)
    return placed(ball, scale=radii_m)


def loft(sections: npt.NDArray[np.float64], rgb: npt.ArrayLike, material: int = PAINT) -> Mesh:
    """A skin over `(s, p, 3)` sections, smooth normals; `rgb` is one colour or one per vertex."""
    du = np.gradient(sections, axis=0)
    dv = np.gradient(sections, axis=1)
    normal = np.cross(du, dv)
    normal /= np.maximum(np.linalg.norm(normal, axis=2, keepdims=True), 1e-9)
    count, points = sections.shape[:2]
    colours = np.asarray(rgb, float)
    return mesh(
        sections.reshape(-1, 3),
        normal.reshape(-1, 3),
        grid_triangles(count, points),
        colours.reshape(-1, 3) if colours.ndim == 3 else colours,
        material,
    )


def grid_triangles(rows: int, columns: int) -> npt.NDArray[np.uint32]:
    """Two triangles for every cell of a `rows x columns` grid of vertices."""
    index = np.arange(rows * columns, dtype=np.uint32).reshape(rows, columns)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    both = np.stack([np.stack([a, b, c], -1), np.stack([a, c, d], -1)], axis=-2)
    triangles: npt.NDArray[np.uint32] = both.reshape(-1, 3)
    return triangles
