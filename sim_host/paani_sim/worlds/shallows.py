"""Shallow water drawn at random: a stretch of a lake or river, shoals in its lane, and a deep way past. Pure."""

import dataclasses
import math

import numpy as np

from paani_sim.worlds.bathymetry import radius_at_depth_m
from paani_sim.worlds.passability import PassabilityGrid
from paani_sim.worlds.route_frame import RouteFrame
from paani_sim.worlds.world import Kind, Obstacle, Pose2, Shoal, World

SHALLOWS = "shallows"
SHALLOWS_OF = ("lake", "river")  # with room beside the lane
MAX_SHOALS = 3
SHOAL_SPACING_M = 14.0  # between middles along the route, at least
CLEAR_ENDS_M = 12.0  # from the start and from the goal to the middle of a shoal
BOTTOM_M, TOP_M, RADIUS_M = (1.5, 3.0), (0.02, 0.1), (6.0, 9.0)
LEAST_RADIUS = 2.4  # of a shoal's height: sand and mud lie less steep than 45 degrees, at the foot too
LEFT_M = (-1.0, 1.0)  # of the middle, beside the lane
DEEP_M, PASSAGE_M = 1.0, 4.0  # of the way past: depth, and width
MAX_TRIES = 40


def add_shoals(
    section: World, route: RouteFrame, length_m: float, grid: PassabilityGrid, rng: np.random.Generator
) -> World | None:
    """The world with one to three shoals in the lane of its open route, or None where none leaves a deep way past."""
    wanted = int(rng.integers(1, MAX_SHOALS + 1))
    world = dataclasses.replace(section, name=SHALLOWS, bottom_m=float(rng.uniform(*BOTTOM_M)), shoals=())
    places_m: list[float] = []
    for _ in range(MAX_TRIES):
        at_m = float(rng.uniform(CLEAR_ENDS_M, length_m - CLEAR_ENDS_M))
        x_m, y_m, _ = route.pose_at(at_m, float(rng.uniform(*LEFT_M)))
        radius_m = max(float(rng.uniform(*RADIUS_M)), LEAST_RADIUS * world.bottom_m)
        shoal = Shoal(x_m, y_m, radius_m, float(rng.uniform(*TOP_M)))
        if any(abs(at_m - other_m) < SHOAL_SPACING_M for other_m in places_m):
            continue
        candidate = dataclasses.replace(world, shoals=(*world.shoals, shoal))
        if grid.is_passable((*world.obstacles, *_shallow_discs(candidate)), (), PASSAGE_M, 1.0):
            world = candidate
            places_m.append(at_m)
            if len(places_m) == wanted:
                break
    return world if places_m else None


def _shallow_discs(world: World) -> list[Obstacle]:
    """What is shallower than `DEEP_M`, as things that a boat must pass."""
    discs = []
    for number, shoal in enumerate(world.shoals):
        side_m = 2.0 * radius_at_depth_m(shoal, world.bottom_m, DEEP_M)
        pose = Pose2(shoal.x_m, shoal.y_m, math.pi / 4.0)
        discs.append(Obstacle(f"shallow_{number}", Kind.OTHER, "island", pose, side_m, side_m, 1.0))
    return discs
