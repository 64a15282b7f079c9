"""The worlds the boat can be put into: pure geometry, and its MuJoCo model in `spec`."""

from collections.abc import Callable

from paani.errors import UserError
from paani_sim.worlds.canal import build_canal
from paani_sim.worlds.faults import Fault, FaultKind
from paani_sim.worlds.harbour import build_harbour
from paani_sim.worlds.lake import build_lake
from paani_sim.worlds.river import build_river
from paani_sim.worlds.scenario import Scenario, Task
from paani_sim.worlds.waterway import build_waterway
from paani_sim.worlds.world import (
    Actor,
    Bank,
    Behaviour,
    Current,
    Kind,
    Light,
    Obstacle,
    Pose2,
    Shoal,
    Waves,
    Wind,
    World,
    actor_distance_along_m,
    actor_pose_along,
    actor_pose_at,
)

FIXED_WORLDS = ("lake", "river", "canal", "harbour")  # a seed draws weather and encounters there, not the layout
WORLDS: dict[str, Callable[[], World]] = {
    "lake": build_lake,
    "river": build_river,
    "canal": build_canal,
    "harbour": build_harbour,
    "waterway": build_waterway,
}


def load_world(name: str) -> World:
    """Build the named world. Raises `UserError` for a name that is not in `WORLDS`."""
    if name not in WORLDS:
        raise UserError(f"world: unknown world {name!r} (known: {', '.join(WORLDS)})")
    return WORLDS[name]()


__all__ = [
    "FIXED_WORLDS",
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
    "Shoal",
    "Task",
    "Waves",
    "Wind",
    "World",
    "actor_distance_along_m",
    "actor_pose_along",
    "actor_pose_at",
    "load_world",
]
