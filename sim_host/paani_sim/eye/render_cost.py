"""CPU time of a rendered picture, by its size and the number of actors."""

import dataclasses

import numpy as np

from paani.clock import process_cpu_s
from paani.statistics.figure_table import FigureTable
from paani.statistics.order_statistics import median, nearest_rank
from paani_sim.eye.camera import BoatPose, Camera
from paani_sim.eye.renderer import Eye
from paani_sim.worlds import World, load_world

WORLD = "river"
SIZES_PX = ((160, 120), (320, 240), (640, 480))
ACTORS = (0, 8, 24)  # at the middle size, beside the world's own
FRAMES, WARM_FRAMES = 60, 3
SAME_FRAMES = 3  # a picture costs what the quickest of so many takes: others use the machine too


def measure_eye() -> FigureTable:
    """CPU time of `Eye.render` round the river's route, one rasterising thread."""
    world = load_world(WORLD)
    rows = []
    for width_px, height_px, actors in _list_cases(len(world.actors)):
        found = frame_costs_ms(with_actors(world, actors), Camera(width_px=width_px, height_px=height_px))
        size = f"{width_px} x {height_px}"
        rows.append((size, actors, median(found), nearest_rank(found, 95), len(found)))
    base = next(row[2] for row in rows if row[:2] == ("320 x 240", len(world.actors)))
    return FigureTable(
        name=f"rendered picture of the {WORLD}",
        columns=("picture", "actors", "CPU ms p50", "CPU ms p95", "n", "ratio of p50"),
        rows=tuple((*row, row[2] / base) for row in rows),
        note=f"CPU time of the process; each picture is drawn {SAME_FRAMES} times and the cheapest counts.",
    )


def _list_cases(own: int) -> list[tuple[int, int, int]]:
    middle = SIZES_PX[1]
    return [(*size, own) for size in SIZES_PX] + [(*middle, actors) for actors in ACTORS]


def with_actors(world: World, count: int) -> World:
    """The world with `count` moving things, its own repeated at even distances along their paths."""
    found = []
    for k in range(count):
        actor = world.actors[k % len(world.actors)]
        found.append(dataclasses.replace(actor, id=f"{actor.id}_{k}", start_m=actor.start_m + 13.0 * k))
    return dataclasses.replace(world, actors=tuple(found))


def frame_costs_ms(world: World, camera: Camera) -> list[float]:
    """CPU milliseconds of each of `FRAMES` pictures along the route."""
    places = world.route_m[np.linspace(0, len(world.route_m) - 1, FRAMES).astype(int)]
    way = np.roll(world.route_m, -1, axis=0) - world.route_m
    yaws = np.arctan2(way[:, 1], way[:, 0])[np.linspace(0, len(world.route_m) - 1, FRAMES).astype(int)]
    found = []
    with Eye(world, camera) as renderer:
        for k in range(-WARM_FRAMES, FRAMES):
            pose = BoatPose(float(places[k, 0]), float(places[k, 1]), float(yaws[k]))
            best_ms = np.inf
            for _ in range(SAME_FRAMES):
                begin_s = process_cpu_s()
                renderer.render(pose, 1.0 * k + WARM_FRAMES)
                best_ms = min(best_ms, 1e3 * (process_cpu_s() - begin_s))
            if k >= 0:
                found.append(best_ms)
    return found
