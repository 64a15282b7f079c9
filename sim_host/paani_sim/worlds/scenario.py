"""A scenario: a world, what goes wrong in it, and what counts as done. Values only."""

from dataclasses import dataclass

from paani.messages import FenceArea
from paani_sim.worlds.faults import Fault
from paani_sim.worlds.world import World


@dataclass(frozen=True)
class Task:
    """Follow the route for `distance_m` along it (0: all of it) within `time_limit_s` of simulated time."""

    distance_m: float = 0.0
    time_limit_s: float = 600.0


@dataclass(frozen=True, eq=False)
class Scenario:
    """`vessel` names a vessel profile. `seed` drives sensors, waves and gusts. The fence holds for the navigator."""

    name: str
    world: World
    seed: int = 1
    vessel: str = "paper"
    task: Task = Task()
    faults: tuple[Fault, ...] = ()
    fence: tuple[FenceArea, ...] = ()
