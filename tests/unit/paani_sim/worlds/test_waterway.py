"""The waterway that every seed lays out anew: its layout, who moves on it, and its light."""

import dataclasses
import itertools

import numpy as np
import pytest

from paani.arrays import F64
from paani.geometry import wrap_rad
from paani_sim.plant.actors import FLIGHT_M, SWIMMER_KEEPS_CLEAR_M, Actors
from paani_sim.trials.seed_parts import FRESH_SEEDS
from paani_sim.worlds import Actor, Behaviour, Kind, Obstacle, Scenario, actor_pose_at
from paani_sim.worlds.curves import clearance_m
from paani_sim.worlds.footprint import build_outline, place_outline
from paani_sim.worlds.generate import draw_random_scenario
from paani_sim.worlds.lighting import LIGHT_CONDITIONS, SUN_AHEAD_RAD
from paani_sim.worlds.passability import footprint_distance_m
from paani_sim.worlds.route_frame import RouteFrame
from paani_sim.worlds.sizes import is_afloat_by_nature
from paani_sim.worlds.traffic import ACTOR_KINDS
from paani_sim.worlds.waterway import build_waterway, draw_waterway_light
from tests.plain_values import as_plain
from tests.unit.paani_sim.worlds.fair_scenarios import check_is_fair

pytestmark = [pytest.mark.slow, pytest.mark.timeout(300)]

SEEDS = 24
BOAT_REACH_M, BOAT_MPS, EVERY_S = 0.65, 0.6, 0.05
ADRIFT_MPS = 0.19


@pytest.fixture(scope="module")
def scenarios() -> tuple[Scenario, ...]:
    return tuple(draw_random_scenario("waterway", seed) for seed in range(SEEDS))


def _outline(thing: Obstacle | Actor) -> F64:
    pose = thing.pose if isinstance(thing, Obstacle) else actor_pose_at(thing, 0.0)
    return place_outline(build_outline(thing), pose)


def _overlap(one: F64, other: F64) -> bool:
    """Whether two convex outlines meet: no edge of either separates them."""
    for edges in (one, other):
        leg = np.roll(edges, -1, axis=0) - edges
        normal = np.column_stack([leg[:, 1], -leg[:, 0]])
        spans = [(points @ normal.T).min(axis=0) for points in (one, other)]
        ends = [(points @ normal.T).max(axis=0) for points in (one, other)]
        if ((spans[0] > ends[1]) | (spans[1] > ends[0])).any():
            return False
    return True


@pytest.mark.parametrize("seed", [0, 7, 10_001, FRESH_SEEDS.start])
def test_a_seed_gives_one_waterway_and_another_seed_another(seed: int) -> None:
    assert as_plain(build_waterway(seed)) == as_plain(build_waterway(seed))
    assert not np.array_equal(build_waterway(seed).shore_m, build_waterway(seed + 1).shore_m)


@pytest.mark.rotating(cpu_s=10)
def test_scenarios_are_fair(scenarios: tuple[Scenario, ...]) -> None:
    for scenario in scenarios:
        check_is_fair(scenario)


def test_every_kind_of_actor_and_every_reaction_appears(scenarios: tuple[Scenario, ...]) -> None:
    actors = [actor for scenario in scenarios for actor in scenario.world.actors]
    looks = {actor.look for actor in actors}
    for name, kind in ACTOR_KINDS.items():
        assert looks & set(kind.looks), name
    assert {actor.behaviour for actor in actors} == set(Behaviour)
    assert max(sum(actor.look == "swimming" for actor in s.world.actors) for s in scenarios) >= 3, (
        "no group of swimmers"
    )


def test_every_condition_appears(scenarios: tuple[Scenario, ...]) -> None:
    seen = {
        name
        for scenario in scenarios
        for name, condition in LIGHT_CONDITIONS.items()
        if scenario.world.light.sky in condition.skies
        and condition.visibility_m[0] <= scenario.world.light.visibility_m <= condition.visibility_m[1]
        and condition.rain_mmph[0] <= scenario.world.light.rain_mmph <= condition.rain_mmph[1]
    }
    assert seen == set(LIGHT_CONDITIONS)


def test_conditions_change_the_light_and_nothing_else() -> None:
    worlds = [build_waterway(3, condition) for condition in LIGHT_CONDITIONS]
    lights = [world.light for world in worlds]
    assert all(one != other for one, other in itertools.combinations(lights, 2))
    same = [as_plain(dataclasses.replace(world, light=lights[0])) for world in worlds]
    assert all(each == same[0] for each in same)


def test_a_low_sun_stands_ahead_of_the_boat(scenarios: tuple[Scenario, ...]) -> None:
    for scenario in scenarios:
        course_rad = scenario.world.start.yaw_rad
        assert scenario.world.light == draw_waterway_light(scenario.seed, course_rad)
        sun_rad = draw_waterway_light(scenario.seed, course_rad, "low_sun").sun_azimuth_rad
        assert abs(wrap_rad(sun_rad - course_rad)) <= SUN_AHEAD_RAD


def test_a_layout_has_every_feature_and_nothing_overlaps(scenarios: tuple[Scenario, ...]) -> None:
    for scenario in scenarios:
        world = scenario.world
        assert {"island", "bridge", "weir", "jetty", "row_2", "weir_buoy_3", "mark_2"} <= {
            o.id for o in world.obstacles
        }
        floating = [o for o in world.obstacles if is_afloat_by_nature(o) or o.look in {"island", "weir", "bridge_pier"}]
        for one, other in itertools.combinations(floating, 2):
            assert not _overlap(_outline(one), _outline(other)), (scenario.name, one.id, other.id)
        for thing in floating:
            ashore = thing.look == "weir"  # its ends are in the bank
            assert ashore or clearance_m(world.shore_m, _outline(thing)).min() > 0.0, (scenario.name, thing.id)


def test_seeds_use_all_of_the_route(scenarios: tuple[Scenario, ...]) -> None:
    starts_m = np.array([scenario.world.start[:2] for scenario in scenarios])
    assert np.ptp(starts_m, axis=0).max() > 0.8 * np.ptp(build_waterway().route_m, axis=0).max()


def test_the_weir_is_marked_on_the_side_of_the_route(scenarios: tuple[Scenario, ...]) -> None:
    for scenario in scenarios:
        world = build_waterway(scenario.seed)
        weir = next(o for o in world.obstacles if o.look == "weir")
        for buoy in (o for o in world.obstacles if o.id.startswith("weir_buoy")):
            off_m = footprint_distance_m(weir, weir.pose, np.array([buoy.pose[:2]]))[0]
            assert off_m > 1.0, (scenario.name, buoy.id)
        distance_m = np.hypot(*(world.route_m - np.array(weir.pose[:2])).T)
        nearest = world.route_m[int(np.argmin(distance_m))]
        buoys = np.array([o.pose[:2] for o in world.obstacles if o.id.startswith("weir_buoy")])
        assert np.hypot(*(buoys - nearest).T).min() < distance_m.min()


def test_nobody_starts_ashore_or_inside_anything(scenarios: tuple[Scenario, ...]) -> None:
    for scenario in scenarios:
        world = scenario.world
        low = [o for o in world.obstacles if o.base_z_m < 0.2]
        for number, actor in enumerate(world.actors):
            outline = _outline(actor)
            assert clearance_m(world.shore_m, outline).min() > 0.0, (scenario.name, actor.id)
            others: list[Obstacle | Actor] = [*low, *world.actors[number + 1 :]]
            for other in others:
                assert not _overlap(outline, _outline(other)), (scenario.name, actor.id, other.id)


def test_who_does_not_see_the_boat_does_not_run_into_one_on_its_route(scenarios: tuple[Scenario, ...]) -> None:
    checked = 0
    for scenario in scenarios:
        frame = RouteFrame(scenario.world.route_m, closed=False)
        for actor in scenario.world.actors:
            if actor.behaviour is not Behaviour.HOLDS_ON or actor.speed_mps <= ADRIFT_MPS:
                continue
            checked += 1
            for t_s in np.arange(0.0, scenario.task.distance_m / BOAT_MPS, 0.5).tolist():
                boat_m = np.array([frame.pose_at(BOAT_MPS * t_s)[:2]])
                gap_m = footprint_distance_m(actor, actor_pose_at(actor, t_s), boat_m)[0]
                assert gap_m > BOAT_REACH_M, (scenario.name, actor.id, t_s)
    assert checked > 5


def test_who_sees_the_boat_stops_short_of_it_or_leaves(scenarios: tuple[Scenario, ...]) -> None:
    """A boat that lies across the path of each, 14 m ahead, and farther than a vessel needs to stop."""
    seen = set[str]()
    for actor in (each for scenario in scenarios for each in scenario.world.actors):
        if actor.behaviour is Behaviour.HOLDS_ON or actor.look in seen:
            continue
        seen.add(actor.look)
        ahead_m = 14.0 + actor.length_m + 4.0 * actor.speed_mps**2
        straight = dataclasses.replace(
            actor, path_m=np.array([[0.0, 0.0], [300.0, 0.0]]), start_m=0.0, start_s=0.0, closed=False
        )
        actors, nearest_m = Actors([straight], EVERY_S, BOAT_REACH_M), np.inf
        for step in range(round(1.5 * ahead_m / actor.speed_mps / EVERY_S)):
            actors.advance(EVERY_S * (step + 1), (ahead_m, 0.0))
            nearest_m = min(nearest_m, ahead_m - actors.along_m[0] - 0.5 * actor.length_m - BOAT_REACH_M)
        least_m = FLIGHT_M - 1.0 if actor.behaviour is Behaviour.FLEES else SWIMMER_KEEPS_CLEAR_M - 0.1
        assert least_m < nearest_m < 0.5 * ahead_m, actor.look
    assert {"swan", "duck"} & seen
    assert len(seen) > 6


def test_a_bird_hurries_away_from_a_boat_that_comes_from_behind() -> None:
    path_m = np.array([[0.0, 0.0], [60.0, 0.0]])
    bird = Actor("b", Kind.OTHER, "duck", path_m, 0.2, 0.5, 0.25, 0.3, closed=False, behaviour=Behaviour.FLEES)
    actors, boat_m, nearest_m = Actors([bird], EVERY_S, BOAT_REACH_M), -8.0, np.inf
    for step in range(round(40.0 / EVERY_S)):
        boat_m += BOAT_MPS * EVERY_S
        actors.advance(EVERY_S * (step + 1), (boat_m, 0.0))
        nearest_m = min(nearest_m, actors.along_m[0] - boat_m)
    assert nearest_m > FLIGHT_M - 0.5


def test_people_and_vessels_are_classes_and_animals_and_logs_are_not(scenarios: tuple[Scenario, ...]) -> None:
    things = list[Obstacle | Actor]()
    for scenario in scenarios:
        things += [*scenario.world.obstacles, *scenario.world.actors]
    kinds = {thing.look: thing.kind for thing in things}
    assert {kinds[look] for look in ("eight", "paddleboard", "jetski", "ferry")} == {Kind.VESSEL}
    assert kinds["swimming"] is Kind.PERSON
    assert {kinds[look] for look in ("dog", "log", "island", "weir", "duck")} == {Kind.OTHER}
