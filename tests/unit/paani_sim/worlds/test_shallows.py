"""Random shallow water: shoals lie in the lane, and a deep way leads past them."""

from __future__ import annotations

import functools
import math

import numpy as np
import pytest

from paani_sim.worlds import Scenario, load_world
from paani_sim.worlds.bathymetry import depth_at_m
from paani_sim.worlds.curves import clearance_m
from paani_sim.worlds.generate import DRAWN_WORLDS, draw_random_scenario
from paani_sim.worlds.load import load_scenario
from paani_sim.worlds.passability import PassabilityGrid, obstacle_distance_m
from paani_sim.worlds.plan_view import SHOAL, draw_plan_view
from paani_sim.worlds.route_frame import RouteFrame, cut_route
from paani_sim.worlds.shallows import DEEP_M, MAX_SHOALS, add_shoals

SEEDS = 8
DRAUGHT_M = 0.19
STEP_M = 1.0


@functools.cache
def scenarios() -> tuple[Scenario, ...]:
    return tuple(load_scenario(f"random:shallows:{seed}") for seed in range(1, SEEDS + 1))


def has_deep_way(scenario: Scenario) -> bool:
    """Whether a boat 2 m wide gets from start to goal in deep water, in steps of a lattice of points."""
    world = scenario.world
    route, length_m = RouteFrame(world.route_m, closed=False), world.route_length_m
    points = [
        (along, left, route.pose_at(along * STEP_M, left * STEP_M)[:2])
        for along in range(math.floor(length_m / STEP_M) + 1)
        for left in range(-14, 15)
    ]
    at_m = np.array([at for *_, at in points])
    room_m = np.minimum(clearance_m(world.shore_m, at_m), obstacle_distance_m(world.obstacles, at_m))
    free = {
        (along, left)
        for (along, left, at), gap_m in zip(points, room_m, strict=True)
        if gap_m > 1.0 and depth_at_m(world, *at) > DEEP_M
    }
    reached, found = {(0, 0)}, [(0, 0)]
    while found:
        along, left = found.pop()
        for step in ((along + 1, left), (along - 1, left), (along, left + 1), (along, left - 1)):
            if step in free and step not in reached:
                reached.add(step)
                found.append(step)
    return (math.floor(length_m / STEP_M), 0) in reached


@pytest.mark.slow
def test_shoals_lie_in_the_lane_and_a_deep_way_leads_past_them() -> None:
    for scenario in scenarios():
        world = scenario.world
        assert 1 <= len(world.shoals) <= MAX_SHOALS
        assert world.actors == ()
        line_m = RouteFrame(world.route_m, closed=False).line_m(0.0, world.route_length_m)
        depths_m = [depth_at_m(world, *point) for point in line_m.tolist()]
        assert min(depths_m) < 0.6, "who follows the route meets one"
        assert depths_m[0] == depths_m[-1] == world.bottom_m
        assert has_deep_way(scenario)
    assert sum(min(each.top_m for each in one.world.shoals) < DRAUGHT_M for one in scenarios()) == SEEDS


@pytest.mark.slow
def test_a_seed_is_always_the_same_water_and_another_is_another() -> None:
    again = draw_random_scenario("shallows", 1)
    assert again.world.shoals == scenarios()[0].world.shoals
    assert again.name == "random:shallows:1"
    assert len({each.world.shoals for each in scenarios()}) == SEEDS
    assert "shallows" in DRAWN_WORLDS


@pytest.mark.slow
def test_water_without_room_for_a_deep_way_past_gets_no_shoal() -> None:
    canal = load_world("canal")
    section, route = cut_route(canal, 20.0, 45.0), RouteFrame(canal.route_m, closed=canal.route_closed, first_m=20.0)
    grid = PassabilityGrid(section, route, 45.0)
    assert [add_shoals(section, route, 45.0, grid, np.random.default_rng(seed)) for seed in range(4)] == [None] * 4


@pytest.mark.slow
def test_the_plan_shows_shoals_and_what_their_colour_means() -> None:
    plan = draw_plan_view(load_scenario("random:shallows:1"), 600, 400)
    is_shoal = (plan == np.array(SHOAL, np.uint8)).all(axis=2)
    legend = np.s_[8:150, 8:36]
    assert is_shoal[legend].sum() > 100
    assert is_shoal.sum() - is_shoal[legend].sum() > 100
    plain = draw_plan_view(load_scenario("lake"), 600, 400)
    assert not (plain[legend] == np.array(SHOAL, np.uint8)).all(axis=2).any()
