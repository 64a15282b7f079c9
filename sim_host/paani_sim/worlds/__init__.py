"""The worlds the boat can be put into: pure geometry, and its MuJoCo model in `spec`."""

from collections.abc import Callable

from paani.errors import UserError
from paani_sim.worlds.canal import canal
from paani_sim.worlds.faults import Fault, FaultKind
from paani_sim.worlds.harbour import harbour
from paani_sim.worlds.lake import lake
from paani_sim.worlds.river import river
from paani_sim.worlds.scenario import Scenario, Task
from paani_sim.worlds.world import (
    Actor,
    Bank,
    Behaviour,
    Current,
    Kind,
    Light,
    Obstacle,
    Pose2,
    Waves,
    Wind,
    World,
    actor_at,
    actor_pose,
    along_at,
)

WORLDS: dict[str, Callable[[], World]] = {"lake": lake, "river": river, "canal": canal, "harbour": harbour}


def load_world(name: str) -> World:
    """Build the named world. Raises `UserError` for a name that is not in `WORLDS`."""
    if name not in WORLDS:
        raise UserError(f"world: unknown world {name!r} (known: {', '.join(WORLDS)})")
    return WORLDS[name]()


__all__ = [
    "WORLDS",
    "Actor",
    "Bank",
    "Behaviour",
    "Current",
    "Fault",
    "FaultKind",
    "Kind",
    "Light",
    "Obstacle",
    "Pose2",
    "Scenario",
    "Task",
    "Waves",
    "Wind",
    "World",
    "actor_at",
    "actor_pose",
    "along_at",
    "load_world",
]
