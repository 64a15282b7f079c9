"""What makes a scenario fair to the boat."""

import numpy as np
import pytest
from scipy import ndimage

from paani.arrays import F64
from paani_sim.worlds import FIXED_WORLDS, Actor, Behaviour, Kind, Obstacle, Scenario, actor_pose_at
from paani_sim.worlds.curves import clearance_m, open_length_m
from paani_sim.worlds.passability import footprint_distance_m, obstacle_distance_m

NOMINAL_BOAT_MPS = 0.6
GRID_M = 0.7


def met(scenario: Scenario) -> tuple[Obstacle | Actor, ...]:
    """What was added to the world."""
    fixed = tuple(o for o in scenario.world.obstacles if o.id.startswith("met_"))
    return (*fixed, *scenario.world.actors)


def fine(line_m: F64, step_m: float = 0.5) -> F64:
    """The open line with a point about every `step_m`."""
    arc_m = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line_m, axis=0), axis=1))])
    at_m = np.linspace(0.0, arc_m[-1], max(2, round(arc_m[-1] / step_m)))
    return np.column_stack([np.interp(at_m, arc_m, line_m[:, k]) for k in (0, 1)])


def check_is_fair(scenario: Scenario) -> None:
    """Route in the water, start clear, paths afloat, and a gap beside whatever stands in the way."""
    world, task = scenario.world, scenario.task
    assert not world.route_closed
    assert clearance_m(world.shore_m, fine(world.route_m)).min() >= 1.5
    assert 30.0 < task.distance_m < 60.1
    assert task.distance_m == pytest.approx(open_length_m(world.route_m))
    assert task.time_limit_s == pytest.approx(3.0 * task.distance_m / NOMINAL_BOAT_MPS + 60.0)
    assert 1 <= len({thing.id.split("_")[1] for thing in met(scenario)}) <= 4
    start_m = np.array([world.start[:2]])
    assert obstacle_distance_m(world.obstacles, start_m)[0] > 2.0
    assert obstacle_distance_m(world.obstacles, world.route_m[-1:])[0] > 2.0
    for actor in world.actors:
        assert footprint_distance_m(actor, actor_pose_at(actor, 0.0), start_m)[0] > 2.0, actor.id
        track_m = fine(actor.path_m)
        assert clearance_m(world.shore_m, track_m).min() > 0.5 * actor.width_m, actor.id
        assert obstacle_distance_m(world.obstacles, track_m).min() > 0.5 * actor.width_m, actor.id
        adrift = actor.kind is Kind.VESSEL and actor.speed_mps <= 0.19
        if scenario.world.name in FIXED_WORLDS:
            assert (actor.behaviour is Behaviour.HOLDS_ON) is adrift, actor.id
    for obstacle in world.obstacles:
        if obstacle.id.startswith("met_"):
            assert clearance_m(world.shore_m, np.array([obstacle.pose[:2]]))[0] > 0.5 * obstacle.width_m, obstacle.id
    assert has_room(scenario), scenario.name


def has_room(scenario: Scenario) -> bool:
    """Whether a disc 2.6 m wide gets from start to goal around the route; actors where they end up."""
    world = scenario.world
    low, high = world.route_m.min(axis=0) - 16.0, world.route_m.max(axis=0) + 16.0
    x_m, y_m = np.arange(low[0], high[0], GRID_M), np.arange(low[1], high[1], GRID_M)
    points_m = np.stack(np.meshgrid(x_m, y_m, indexing="ij"), axis=-1).reshape(-1, 2)
    gap_m = np.minimum(clearance_m(world.shore_m, points_m), obstacle_distance_m(world.obstacles, points_m))
    for actor in world.actors:
        gap_m = np.minimum(gap_m, footprint_distance_m(actor, actor_pose_at(actor, 1e5), points_m))
    area, _ = ndimage.label((gap_m > 1.3).reshape(len(x_m), len(y_m)))
    start, goal = (
        area[int(np.argmin(np.abs(x_m - end[0]))), int(np.argmin(np.abs(y_m - end[1])))]
        for end in (world.route_m[0], world.route_m[-1])
    )
    return bool(start == goal != 0)
