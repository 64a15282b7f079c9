"""Banks, hills, plants and houses around a world's water. Pure numpy."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from paani.arrays import F64
from paani_sim.eye import sprites
from paani_sim.eye.buildings import house
from paani_sim.eye.mesh import LAND, Mesh, grid_triangles, loft, merge, placed
from paani_sim.eye.nature import island_height_m
from paani_sim.eye.quay import PAVED_M, QUAY_TOP_M, furniture, quay
from paani_sim.eye.structures import bridge_reach_m
from paani_sim.worlds.curves import clearance_m, normals_left, resample_closed
from paani_sim.worlds.world import Bank, Kind, World

REACH_M = 460.0
ROWS_M = (-4.0, -1.6, -0.5, 0.0, 0.35, 0.9, 1.8, 3.2, 5.5, 9.0, 14.0, 21.0)
COARSE_M, FAR_CELLS = 14.0, 3  # cells of the ground behind the banks; how many make one beyond `FAR_M`
FAR_M = 84.0
ROADSIDE_M = 0.5


@dataclass(frozen=True, eq=False)
class Land:
    """`ground`, `houses` and small `details` as meshes; `plants` `(n, 7)`: x, y, z, width, height, layer, shade."""

    ground: Mesh
    houses: tuple[Mesh, ...]
    details: tuple[Mesh, ...]
    plants: npt.NDArray[np.float32]


def make_land(world: World) -> Land:
    """The land of a world, the same for the same seed."""
    rng = np.random.default_rng([world.seed, 1])
    field = _NoiseField(rng, world.bank)
    edge_rng = np.random.default_rng([world.seed, 4])
    quayed = world.bank is Bank.QUAY
    edge = quay(world, edge_rng) if quayed else _shore_strip(world, field)
    return Land(
        details=furniture(world, edge_rng) if quayed else (),
        ground=merge(edge, *_far_ground(world, field), _hills(world, field)),
        houses=_houses(world, field, rng),
        plants=np.concatenate([_plants(world, field, rng), _island_plants(world)]),
    )


class _NoiseField:
    """Smooth noise of position, about -1..1, from a handful of waves; and what the land's edge is made of."""

    def __init__(self, rng: np.random.Generator, bank: Bank) -> None:
        self.bank = bank
        self._angle = rng.uniform(0.0, 2.0 * np.pi, (3, 6))
        self._phase = rng.uniform(0.0, 2.0 * np.pi, (3, 6))

    def at(self, xy_m: F64, wave_m: float, layer: int = 0) -> F64:
        total = np.zeros(len(xy_m))
        for k in range(6):
            a, p = self._angle[layer, k], self._phase[layer, k]
            k_radpm = 2.0 * np.pi / (wave_m * (0.6 + 0.2 * k))
            total += np.sin(k_radpm * (xy_m[:, 0] * np.cos(a) + xy_m[:, 1] * np.sin(a)) + p)
        return total / 3.0


def ground_height_m(field: _NoiseField, xy_m: F64, clear_m: F64) -> F64:
    """Height of the ground `clear_m` from the shore: a steep foot or a wall, a gentle bank, hills far off."""
    quayed = field.bank is Bank.QUAY
    clear = clear_m if quayed else clear_m + 0.25 * field.at(xy_m, 5.0)
    inland = np.maximum(-clear, 0.0)
    rough = field.at(xy_m, 24.0, 1) * np.clip((inland - PAVED_M * quayed) / 8.0, 0.0, 1.0) * 0.5
    rise = np.clip((inland - 50.0) / 260.0, 0.0, 1.0)
    hills = rise**2 * (3.0 - 2.0 * rise) * (16.0 + 10.0 * field.at(xy_m, 300.0, 2))
    if quayed:
        behind = np.maximum(inland - PAVED_M, 0.0)
        return np.where(inland > 0.0, QUAY_TOP_M + 0.02 * behind + 0.4 * rough + hills, -2.0)
    dry = 0.75 * (1.0 - np.exp(-inland / 1.6)) + 0.035 * inland + rough + hills
    return np.where(clear > 0.0, np.maximum(-0.45 * clear, -2.0), dry)


def _ground_rgb(field: _NoiseField, xy_m: F64, z_m: F64, inland_m: F64) -> F64:
    """Mud and stones by the water, then grass in patches, then woodland."""
    dry = 0.5 + 0.5 * np.clip(field.at(xy_m, 30.0, 2), -1.0, 1.0)
    grass = np.array([0.28, 0.32, 0.15]) + dry[:, None] * np.array([0.14, 0.08, 0.05])
    wood = np.array([0.20, 0.26, 0.11])
    mud = np.array([0.34, 0.29, 0.22]) + 0.05 * field.at(xy_m, 7.0, 1)[:, None]
    wet = np.clip((0.42 - z_m) / 0.30, 0.0, 1.0)[:, None]
    far = np.clip((inland_m - 30.0) / 60.0, 0.0, 1.0)[:, None]
    rgb = grass * (1.0 - far) + wood * far
    rgb = rgb * (1.0 - wet) + mud * wet
    lit: F64 = np.clip(rgb * np.where(z_m < 0.12, 0.62, 1.0)[:, None], 0.03, 1.0)
    return lit


def _surface(field: _NoiseField, grid_xy: F64, clear: F64, sink_m: float) -> Mesh:
    """Ground over a grid `(rows, columns, 2)` of known clearance, `sink_m` lower than it is."""
    rows, columns = grid_xy.shape[:2]
    flat = grid_xy.reshape(-1, 2)
    z = ground_height_m(field, flat, clear) - sink_m
    rgb = _ground_rgb(field, flat, z, np.maximum(-clear, 0.0))
    points = np.concatenate([grid_xy, z.reshape(rows, columns, 1)], axis=2)
    return loft(points, rgb.reshape(rows, columns, 3), LAND)


def _shore_strip(world: World, field: _NoiseField) -> Mesh:
    shore = resample_closed(world.shore_m, int(len(world.shore_m) * 1.3))
    outward = -normals_left(shore, closed=True)
    ring = np.vstack([shore, shore[:1]])
    outward = np.vstack([outward, outward[:1]])
    grid = np.stack([ring + row * outward for row in ROWS_M], axis=0)
    return _surface(field, grid, clearance_m(world.shore_m, grid.reshape(-1, 2)), 0.0)


def _far_ground(world: World, field: _NoiseField) -> tuple[Mesh, Mesh]:
    """Ground behind the banks on a grid, coarser far from the water."""
    low, high = world.shore_m.min(axis=0) - REACH_M, world.shore_m.max(axis=0) + REACH_M
    count = np.ceil((high - low) / (COARSE_M * FAR_CELLS)).astype(int) * FAR_CELLS + 1
    x, y = (low[k] + COARSE_M * np.arange(count[k]) for k in (0, 1))
    fine = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)
    coarse = fine[::FAR_CELLS, ::FAR_CELLS]
    clear = clearance_m(world.shore_m, fine.reshape(-1, 2)).reshape(fine.shape[:2])
    rough = clear[::FAR_CELLS, ::FAR_CELLS].reshape(-1)
    is_far = rough[grid_triangles(*coarse.shape[:2])].max(axis=1) < -FAR_M
    far_cells = is_far.reshape(-1, 2).all(axis=1).reshape(coarse.shape[0] - 1, coarse.shape[1] - 1)
    near_cells = ~np.kron(far_cells, np.ones((FAR_CELLS, FAR_CELLS), bool))
    edge_m = -PAVED_M if field.bank is Bank.QUAY else -4.0
    near = _surface(field, fine, clear.reshape(-1), 0.12)
    far = _surface(field, coarse, rough, 0.12)
    dry = (clear.reshape(-1)[near.triangles] < edge_m).all(axis=1) & np.repeat(near_cells.reshape(-1), 2)
    return (
        Mesh(near.vertices, near.triangles[dry]),
        Mesh(far.vertices, far.triangles[np.repeat(far_cells.reshape(-1), 2)]),
    )


def _hills(world: World, field: _NoiseField) -> Mesh:
    """A ring of wooded hills that closes every view."""
    middle = 0.5 * (world.shore_m.min(axis=0) + world.shore_m.max(axis=0))
    half = 0.5 * np.ptp(world.shore_m, axis=0)
    angle = np.linspace(0.0, 2.0 * np.pi, 121)
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    rows = []
    for out_m, height_m in ((300.0, 4.0), (420.0, 16.0), (560.0, 34.0), (700.0, 52.0)):
        xy = middle + circle * (half + out_m)
        swell = 1.0 + 0.55 * field.at(xy, 420.0, 2) + 0.12 * field.at(xy, 60.0, 1)
        rows.append(np.column_stack([xy, height_m * np.maximum(swell, 0.25)]))
    points = np.stack(rows)
    rgb = np.broadcast_to(np.array([0.19, 0.26, 0.13]), points.shape)
    return loft(points, rgb, LAND)


def _houses(world: World, field: _NoiseField, rng: np.random.Generator) -> tuple[Mesh, ...]:
    shore = resample_closed(world.shore_m, 400)
    outward = -normals_left(shore, closed=True)
    found: list[Mesh] = []
    quayed = field.bank is Bank.QUAY
    near_m, far_m, most, apart_m = (PAVED_M + 5.5, 34.0, 30, 17.0) if quayed else (16.0, 46.0, 14, 20.0)
    taken: list[F64] = [np.array(o.pose[:2]) for o in world.obstacles if o.kind is Kind.OTHER]
    for _ in range(160):
        index = int(rng.integers(400))
        spot = shore[index] + outward[index] * rng.uniform(near_m, far_m)
        clear = clearance_m(world.shore_m, spot[None])
        if clear[0] > 2.0 - near_m:
            continue
        if any(np.hypot(*(spot - other)) < apart_m for other in taken):
            continue
        taken.append(spot)
        z = float(ground_height_m(field, spot[None], clear)[0])
        along = float(np.arctan2(outward[index, 0], -outward[index, 1]))
        size = (float(rng.uniform(9, 15)), float(rng.uniform(7, 10)), float(rng.uniform(3.2, 6.4)))
        found.append(
            placed(
                house(*size, int(rng.integers(12))),
                (float(spot[0]), float(spot[1]), z),
                yaw_rad=along + float(rng.normal(0.0, 0.25)),
            )
        )
        if len(found) == most:
            break
    return tuple(found)


class _PlantKind(NamedTuple):
    """Plants of one sort: how many, how far inland, in patches of what size and how sparse."""

    layers: tuple[int, ...]
    plants: int
    inland_m: tuple[float, float]
    patch_m: float
    bar: float
    width_m: tuple[float, float]
    height_m: tuple[float, float]
    free_m: float


_PLANT_KINDS = (
    _PlantKind(sprites.REED, 420, (-0.5, 0.5), 24.0, 0.25, (1.5, 2.6), (1.2, 2.2), 2.0),
    _PlantKind(sprites.REED, 1500, (0.3, 5.0), 30.0, -0.6, (0.7, 1.5), (0.25, 0.6), 1.0),
    _PlantKind(sprites.BUSH, 700, (0.9, 6.0), 18.0, -0.1, (1.8, 4.2), (1.2, 3.0), 3.0),
    _PlantKind(sprites.WILLOW, 46, (2.2, 6.0), 40.0, 0.1, (7.0, 10.0), (7.0, 10.0), 6.0),
    _PlantKind(sprites.BROADLEAF, 700, (5.0, 34.0), 55.0, -0.25, (7.0, 12.0), (8.0, 14.0), 5.0),
    _PlantKind(sprites.POPLAR, 60, (8.0, 30.0), 60.0, 0.0, (6.0, 9.0), (12.0, 17.0), 5.0),
    _PlantKind(sprites.CONIFER, 160, (12.0, 60.0), 80.0, 0.1, (5.0, 7.5), (10.0, 17.0), 5.0),
    _PlantKind(sprites.WOOD_EDGE, 260, (40.0, 130.0), 90.0, -0.5, (22.0, 32.0), (11.0, 16.0), 5.0),
    _PlantKind(sprites.WOOD_EDGE, 320, (120.0, 380.0), 200.0, -0.9, (34.0, 52.0), (14.0, 20.0), 5.0),
)


def _plants(world: World, field: _NoiseField, rng: np.random.Generator) -> npt.NDArray[np.float32]:
    """Reeds and bushes at the edge, trees behind, woodland to the hills; open meadows between."""
    shore = resample_closed(world.shore_m, 4000)
    outward = -normals_left(shore, closed=True)
    open_kinds = (Kind.PERSON, Kind.PIER, Kind.OTHER)
    keep_free = np.array([o.pose[:2] for o in world.obstacles if o.kind in open_kinds]).reshape(-1, 2)
    rows = []
    quayed = world.bank is Bank.QUAY
    for kind in _PLANT_KINDS:
        near, far = kind.inland_m
        if quayed:
            if far <= PAVED_M:
                continue
            near = max(near, PAVED_M + 1.0)
        index = rng.integers(len(shore), size=kind.plants * 2)
        xy = shore[index] + outward[index] * rng.uniform(near, far, len(index))[:, None]
        xy = xy[field.at(xy, kind.patch_m, kind.layers[0] % 3) > kind.bar]
        gap = np.linalg.norm(xy[:, None] - keep_free[None], axis=2)
        xy = xy[(gap > kind.free_m).all(axis=1)]
        clear = clearance_m(world.shore_m, xy)
        fits = (clear < -0.8 * near) if near > 0.0 else (np.abs(clear) < 0.8)
        xy, clear = xy[fits][: kind.plants], clear[fits][: kind.plants]
        width, height = rng.uniform(*kind.width_m, len(xy)), rng.uniform(*kind.height_m, len(xy))
        z = ground_height_m(field, xy, clear) - 0.03 * height
        layer = rng.choice(np.asarray(kind.layers), len(xy))
        shade = rng.uniform(0.8, 1.15, len(xy))
        rows.append(np.column_stack([xy, z, width, height, layer, shade]))
    found = np.concatenate(rows).astype(np.float32)
    return found[~_is_on_bridge(world, found[:, :2])]


def _island_plants(world: World) -> npt.NDArray[np.float32]:
    """Reeds round the edge of each island, bushes and a few trees on it."""
    rows = [np.zeros((0, 7))]
    for number, thing in enumerate(o for o in world.obstacles if o.look == "island"):
        rng = np.random.default_rng([world.seed, 6, number])
        per_m = 0.1 * (thing.length_m + thing.width_m)
        for kind, share in _ISLAND_PLANTS:
            count = round(kind.plants * per_m)
            turn, out = rng.uniform(0.0, 2.0 * np.pi, count), rng.uniform(*share, count)
            own = np.column_stack([np.cos(turn), np.sin(turn)]) * out[:, None]
            own *= [0.5 * thing.length_m, 0.5 * thing.width_m]
            cos, sin = np.cos(thing.pose.yaw_rad), np.sin(thing.pose.yaw_rad)
            xy = own @ np.array([[cos, sin], [-sin, cos]]) + np.array(thing.pose[:2])
            width, height = rng.uniform(*kind.width_m, count), rng.uniform(*kind.height_m, count)
            z = [island_height_m(thing.length_m, thing.width_m, *at) for at in own.tolist()] - 0.03 * height
            layer = rng.choice(np.asarray(kind.layers), count)
            rows.append(np.column_stack([xy, z, width, height, layer, rng.uniform(0.8, 1.15, count)]))
    return np.concatenate(rows).astype(np.float32)


# Of a small island: how many for each 10 m of its length and width together, and how far out they stand.
_ISLAND_PLANTS = (
    (_PlantKind(sprites.REED, 26, (0.0, 0.0), 0.0, 0.0, (0.7, 1.4), (0.5, 1.1), 0.0), (0.84, 0.97)),
    (_PlantKind(sprites.BUSH, 9, (0.0, 0.0), 0.0, 0.0, (1.6, 3.0), (1.2, 2.6), 0.0), (0.0, 0.72)),
    (_PlantKind(sprites.BROADLEAF, 2, (0.0, 0.0), 0.0, 0.0, (4.0, 6.5), (5.0, 9.0), 0.0), (0.0, 0.4)),
)


def _is_on_bridge(world: World, xy_m: npt.NDArray[np.float32]) -> npt.NDArray[np.bool_]:
    """Where the road of a bridge, or a ramp up to it, lies over the ground."""
    under = np.zeros(len(xy_m), np.bool_)
    for thing in (o for o in world.obstacles if o.look == "bridge"):
        cos, sin = np.cos(thing.pose.yaw_rad), np.sin(thing.pose.yaw_rad)
        own_m = (xy_m - np.array(thing.pose[:2])) @ np.array([[cos, -sin], [sin, cos]])
        reach_m = bridge_reach_m(thing.length_m, thing.base_z_m)
        under |= (np.abs(own_m[:, 0]) < reach_m) & (np.abs(own_m[:, 1]) < 0.5 * thing.width_m + ROADSIDE_M)
    return under
