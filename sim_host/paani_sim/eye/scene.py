"""A world as vertex rows: fixed things, moving things, plants, and the numbers of the label picture."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from paani.arrays import F32, U32
from paani_sim.eye.boats import boat
from paani_sim.eye.buildings import crane, warehouse
from paani_sim.eye.land import make_land
from paani_sim.eye.mesh import Mesh, placed
from paani_sim.eye.nature import dog, duck, island, log, swan
from paani_sim.eye.people import person
from paani_sim.eye.river_works import bridge_pier, weir
from paani_sim.eye.structures import bridge, buoy, pier
from paani_sim.eye.wave_motion import is_floating
from paani_sim.worlds.world import Actor, Kind, Obstacle, World

SKY, WATER, LAND, FIRST_THING = 0, 1, 2, 3
ROW_WIDTHS = (3, 3, 4, 1)
PLANT_WIDTHS = (3, 4, 2)
_OTHERS: dict[str, Callable[[float, float, float, int], Mesh]] = {
    "crane": crane,
    "warehouse": warehouse,
    "island": island,
    "weir": weir,
    "bridge_pier": bridge_pier,
    "log": log,
    "dog": dog,
    "swan": swan,
    "duck": duck,
}


class Thing(NamedTuple):
    """A numbered thing in the label picture; a crew member's `part_of` is the boat's id."""

    number: int
    id: str
    kind: Kind
    part_of: str


class Rows(NamedTuple):
    """Vertex rows and triangle indices."""

    rows: F32
    order: U32


class MovableRows(NamedTuple):
    """A thing that moves, and its rows in its own frame."""

    thing: Obstacle | Actor
    rows: Rows


@dataclass(frozen=True, eq=False)
class PlacedObstacles:
    """Obstacles: what stands still, in the map; what floats; and their numbers."""

    still: Rows
    afloat: tuple[MovableRows, ...]
    things: tuple[Thing, ...]


@dataclass(frozen=True, eq=False)
class Scene:
    """Everything the renderer uploads once; `details` are too small to be seen from afar.

    `plants` are cards, `grown` `(n, 7)` what they stand for: x, y, z, width, height, layer, shade.
    """

    still: Rows
    details: Rows
    afloat: tuple[MovableRows, ...]
    actors: tuple[MovableRows, ...]
    plants: Rows
    grown: F32
    things: tuple[Thing, ...]


def make_scene(world: World) -> Scene:
    """Build the scene of a world. Numbers follow the order of obstacles, then actors."""
    land = make_land(world)
    ground = [numbered(part, LAND) for part in (land.ground, *land.houses)]
    stands = place_obstacles(world.obstacles, FIRST_THING)
    things = list(stands.things)
    actors = []
    for actor in world.actors:
        parts = _build(actor)
        new = _things(actor, len(parts), FIRST_THING + len(things))
        actors.append(MovableRows(actor, join(numbered(p, t.number) for p, t in zip(parts, new, strict=True))))
        things += new
    details = join(numbered(part, LAND) for part in land.details)
    return Scene(
        join([*ground, stands.still]),
        details,
        stands.afloat,
        tuple(actors),
        _plant_rows(land.plants),
        land.plants,
        tuple(things),
    )


def place_obstacles(obstacles: Iterable[Obstacle], first: int) -> PlacedObstacles:
    """Rows of obstacles where they stand or float, numbered from `first`."""
    still: list[Rows] = []
    afloat: list[MovableRows] = []
    things: list[Thing] = []
    for obstacle in obstacles:
        parts = _build(obstacle)
        new = _things(obstacle, len(parts), first + len(things))
        things += new
        if is_floating(obstacle):
            afloat.append(MovableRows(obstacle, join(numbered(p, t.number) for p, t in zip(parts, new, strict=True))))
            continue
        pose = obstacle.pose
        foot_m = 0.0 if obstacle.look == "bridge" else obstacle.base_z_m
        for part, thing in zip(parts, new, strict=True):
            there = placed(part, (pose.x_m, pose.y_m, foot_m), yaw_rad=pose.yaw_rad)
            still.append(numbered(there, thing.number))
    return PlacedObstacles(join(still), tuple(afloat), tuple(things))


def numbered(part: Mesh, number: int) -> Rows:
    """The mesh as rows that carry a number."""
    column = np.full((len(part.vertices), 1), number, np.float32)
    return Rows(np.concatenate([part.vertices, column], axis=1), part.triangles.reshape(-1))


def join(parts: Iterable[Rows]) -> Rows:
    """All rows in one; empty input gives empty rows."""
    rows, index, offset = [np.zeros((0, 11), np.float32)], [np.zeros(0, np.uint32)], 0
    for part in parts:
        rows.append(part.rows)
        index.append(part.order + np.uint32(offset))
        offset += len(part.rows)
    return Rows(np.concatenate(rows), np.concatenate(index))


def _build(thing: Obstacle | Actor) -> list[Mesh]:
    """The thing's meshes in its own frame: itself first, then its crew."""
    size = (thing.length_m, thing.width_m, thing.height_m)
    if thing.kind is Kind.VESSEL:
        return boat(thing.look, *size, thing.variant)
    if thing.kind is Kind.BUOY:
        return [buoy(thing.look, thing.width_m, thing.height_m, thing.variant)]
    if thing.kind is Kind.PIER:
        return [pier(thing.look, *size, thing.variant)]
    if thing.kind is Kind.PERSON:
        return [person(thing.look, thing.height_m, thing.variant)]
    if thing.look in _OTHERS:
        return [_OTHERS[thing.look](*size, thing.variant)]
    base_z_m = thing.base_z_m if isinstance(thing, Obstacle) else 0.0
    return [bridge(thing.length_m, thing.width_m, base_z_m, thing.height_m)]


def _things(thing: Obstacle | Actor, parts: int, first: int) -> list[Thing]:
    own = Thing(first, thing.id, thing.kind, "")
    crew = [Thing(first + k, f"{thing.id}_crew_{k}", Kind.PERSON, thing.id) for k in range(1, parts)]
    return [own, *crew]


def _plant_rows(plants: F32) -> Rows:
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
    count = len(plants)
    rows = np.concatenate([np.repeat(plants, 4, axis=0), np.tile(corners, (count, 1))], axis=1).astype(np.float32)
    quad = np.array([0, 1, 2, 0, 2, 3], np.uint32)
    index = (4 * np.arange(count, dtype=np.uint32)[:, None] + quad).reshape(-1)
    return Rows(rows, index.astype(np.uint32))
