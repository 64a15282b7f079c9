"""Two hundred scenarios drawn at random are fair; those of waterways are checked where their layout is."""

import pytest

from paani_sim.worlds import FIXED_WORLDS
from paani_sim.worlds.generate import draw_random_scenario
from tests.unit.paani_sim.worlds.fair_scenarios import check_is_fair


@pytest.mark.rotating(cpu_s=30)
@pytest.mark.timeout(300)
@pytest.mark.parametrize("name", sorted(FIXED_WORLDS))
def test_fifty_scenarios_of_each_world_are_fair(name: str) -> None:
    for seed in range(50):
        check_is_fair(draw_random_scenario(name, seed))
