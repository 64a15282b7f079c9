"""Scenarios drawn at random: fair to the boat, and always the same for the same seed."""

import numpy as np
import pytest

from paani.errors import UserError
from paani_sim.worlds import FIXED_WORLDS, WORLDS, Scenario, actor_pose_at, load_world
from paani_sim.worlds.generate import draw_random_scenario
from paani_sim.worlds.passability import HEADROOM_M, footprint_distance_m
from paani_sim.worlds.spec import build_spec
from tests.plain_values import as_plain
from tests.unit.paani_sim.worlds.fair_scenarios import check_is_fair, fine

SEEDS = 4


@pytest.fixture(scope="module", params=sorted(WORLDS))
def scenarios(request: pytest.FixtureRequest) -> tuple[Scenario, ...]:
    return tuple(draw_random_scenario(request.param, seed) for seed in range(SEEDS))


@pytest.mark.rotating(cpu_s=3)
def test_scenarios_are_fair(scenarios: tuple[Scenario, ...]) -> None:
    """Route in the water, start clear, paths afloat, and a gap beside whatever stands in the way."""
    for scenario in scenarios:
        check_is_fair(scenario)


def test_the_same_seed_gives_the_same_scenario(scenarios: tuple[Scenario, ...]) -> None:
    first = scenarios[2]
    again = draw_random_scenario(first.world.name, 2)
    assert as_plain(again) == as_plain(first)
    assert as_plain(scenarios[3]) != as_plain(first)


def test_seeds_use_all_of_the_route(scenarios: tuple[Scenario, ...]) -> None:
    name = scenarios[0].world.name
    if name not in FIXED_WORLDS:
        pytest.skip("another layout for every seed: test_waterway.py has it")
    starts_m = np.array([s.world.start[:2] for s in scenarios])
    assert np.ptp(starts_m, axis=0).max() > 0.5 * np.ptp(load_world(name).route_m, axis=0).max()


def test_moving_things_come_near_the_boat(scenarios: tuple[Scenario, ...]) -> None:
    """A boat at 0.6 m/s that avoids nothing comes within 5 m of each moving thing's footprint."""
    for scenario in scenarios:
        line_m = fine(scenario.world.route_m, 0.6)
        for actor in scenario.world.actors:
            gaps_m = [
                footprint_distance_m(actor, actor_pose_at(actor, float(t_s)), here[None])[0]
                for t_s, here in enumerate(line_m)
            ]
            assert min(gaps_m) < 5.0, (scenario.name, actor.id)


def test_scenarios_are_models(scenarios: tuple[Scenario, ...]) -> None:
    model = build_spec(scenarios[0].world).compile()
    assert model.nmocap == len(scenarios[0].world.actors)


def test_bridges_do_not_block() -> None:
    assert all(o.base_z_m > HEADROOM_M for name in WORLDS for o in load_world(name).obstacles if o.look == "bridge")


def test_unknown_worlds_are_named() -> None:
    with pytest.raises(UserError, match="'pond'"):
        draw_random_scenario("pond", 1)
