"""Where along a route a thing is met, and the actor that is met there."""

import dataclasses

import numpy as np

from paani_sim.worlds import encounter_paths
from paani_sim.worlds.encounter_paths import TimedPath
from paani_sim.worlds.route_frame import RouteFrame
from paani_sim.worlds.sizes import Size
from paani_sim.worlds.world import Actor, Behaviour, World


@dataclasses.dataclass(frozen=True, eq=False)
class MeetingPlace:
    """Where along the route a thing is met, its id, and how often people in the water or on it are (`Traffic`)."""

    world: World
    route: RouteFrame
    length_m: float
    at_m: float
    id: str
    people_factor: int = 1


def build_actor(
    place: MeetingPlace,
    look: str,
    size: Size,
    timed_path: TimedPath | None,
    speed_mps: float,
    behaviour: Behaviour,
    rng: np.random.Generator,
) -> Actor | None:
    """None without a run, or where its path is not free."""
    if timed_path is None:
        return None
    actor = Actor(
        place.id,
        size.kind,
        look,
        timed_path.path_m,
        speed_mps,
        size.length_m,
        size.width_m,
        size.height_m,
        timed_path.start_m,
        int(rng.integers(12)),
        closed=False,
        start_s=timed_path.start_s,
        behaviour=behaviour,
    )
    return actor if encounter_paths.is_path_clear(place.world, actor) else None
