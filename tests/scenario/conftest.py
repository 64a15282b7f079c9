"""Boats of closed-loop tests, whose plants are closed however a test ends."""

from collections.abc import Callable, Iterator

import pytest

from paani.config import load_config
from paani_sim.worlds import World
from tests.guidance_loop import Lockstep

Launch = Callable[..., Lockstep]


@pytest.fixture
def launch() -> Iterator[Launch]:
    opened: list[Lockstep] = []

    def make(world: World, profile: str = "paani", *sets: str, seed: int = 1) -> Lockstep:
        opened.append(Lockstep(world, load_config(profile=profile, sets=sets), seed))
        return opened[-1]

    yield make
    for each in opened:
        each.plant.close()
