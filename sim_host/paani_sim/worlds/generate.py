"""Scenarios drawn at random: a stretch of a world's route, one to four things to meet on it, light and weather."""

import dataclasses
import math
import zlib
from collections.abc import Callable

import numpy as np

from paani.arrays import F64
from paani_sim.worlds import load_world, meetings
from paani_sim.worlds.meetings import BOAT_MPS, Run
from paani_sim.worlds.room import Lattice, fixed_gap_m
from paani_sim.worlds.scenario import Scenario, Task
from paani_sim.worlds.sizes import SIZES
from paani_sim.worlds.way import Way, stretch
from paani_sim.worlds.world import (
    Actor,
    Behaviour,
    Current,
    Light,
    Obstacle,
    Pose2,
    Waves,
    Wind,
    World,
    actor_pose,
)

DISTANCE_M = (35.0, 60.0)
ROOM_M = 3.0  # the least width of a gap that leads on
APART_M = 8.0  # between the places of two encounters
FREE_AT_ENDS_M = 4.0
FREE_BEYOND_M = 8.0  # nothing is met so near the goal, or stands so far behind it
MOST = 4
TRIES = 60
FETCH_M = {"lake": 200.0, "river": 80.0, "canal": 40.0, "harbour": 120.0}
WATERS = ((0.30, 0.34, 0.22), (0.40, 0.36, 0.24), (0.20, 0.28, 0.26), (0.16, 0.24, 0.30), (0.46, 0.42, 0.32))
BUOYS = ("can", "cone", "sphere", "pillar", "spar")
MOORED = ("rowboat", "dinghy", "cruiser", "workboat", "sailboat", "barge")
UNDER_WAY = ("dinghy", "kayak", "cruiser", "workboat")
ADRIFT = ("rowboat", "dinghy", "kayak")

Draw = Callable[["_Place", np.random.Generator], Obstacle | Actor | None]


@dataclasses.dataclass(frozen=True, eq=False)
class _Place:
    """Where on the way something shall be met, and what it is called."""

    world: World
    way: Way
    length_m: float
    at_m: float
    id: str


def random_scenario(kind: str, seed: int) -> Scenario:
    """The scenario of this kind of world and seed (0 or more), always the same. Raises UserError for an unknown world.

    The boat follows an open stretch of the world's route. Whatever is met, a gap of 3 m leads on at any time.
    """
    rng = np.random.default_rng([zlib.crc32(kind.encode()), seed])
    world = dataclasses.replace(_weathered(load_world(kind), rng), actors=())
    while True:
        found = _stretch_with_encounters(world, rng)
        if found is not None:
            break
    length_m = found.route_length_m
    return Scenario(
        name=f"random:{kind}:{seed}",
        world=found,
        seed=seed,
        task=Task(distance_m=length_m, time_limit_s=3.0 * length_m / BOAT_MPS + 60.0),
    )


def _stretch_with_encounters(world: World, rng: np.random.Generator) -> World | None:
    """A stretch somewhere along the route with at least one encounter, or None where it does not work out."""
    from_m, length_m = rng.uniform(0.0, world.route_length_m), rng.uniform(*DISTANCE_M)
    way = Way(world.route_m, closed=world.route_closed, first_m=from_m)
    cut = stretch(world, from_m, length_m)
    lattice = Lattice(cut, way, length_m)
    start_gap_m = fixed_gap_m(cut.obstacles, np.array([cut.start[:2]]))[0]
    goal_gap_m = fixed_gap_m(cut.obstacles, way.line_m(length_m, length_m + FREE_BEYOND_M)).min()
    if min(start_gap_m, goal_gap_m) < FREE_AT_ENDS_M or not lattice.is_passable(cut.obstacles, (), ROOM_M, BOAT_MPS):
        return None
    wanted, met_m = int(rng.integers(1, MOST + 1)), list[float]()
    for number in range(TRIES):
        at_m = float(rng.uniform(10.0, length_m - FREE_BEYOND_M))
        if any(abs(at_m - other_m) < APART_M for other_m in met_m):
            continue
        draw = _DRAWS[int(rng.choice(len(_DRAWS), p=_CHANCES))]
        thing = draw(_Place(cut, way, length_m, at_m, f"met_{number}"), rng)
        if thing is None:
            continue
        fuller = _with(cut, thing)
        if (
            _is_clear_of_start(cut, thing)
            and all(meetings.is_free_path(fuller, actor) for actor in cut.actors)
            and lattice.is_passable(fuller.obstacles, fuller.actors, ROOM_M, BOAT_MPS)
        ):
            cut = fuller
            met_m.append(at_m)
            if len(met_m) == wanted:
                break
    return cut if met_m else None


def _with(world: World, thing: Obstacle | Actor) -> World:
    if isinstance(thing, Obstacle):
        return dataclasses.replace(world, obstacles=(*world.obstacles, thing))
    return dataclasses.replace(world, actors=(*world.actors, thing))


def _is_clear_of_start(world: World, thing: Obstacle | Actor) -> bool:
    pose = thing.pose if isinstance(thing, Obstacle) else actor_pose(thing, 0.0)
    gap_m = math.hypot(pose.x_m - world.start.x_m, pose.y_m - world.start.y_m)
    return gap_m - 0.5 * thing.length_m > FREE_AT_ENDS_M


def _buoy(place: _Place, rng: np.random.Generator) -> Obstacle | None:
    return _fixed(place, str(rng.choice(BUOYS)), place.way.at(place.at_m, rng.uniform(-1.2, 1.2)), rng)


def _moored(place: _Place, rng: np.random.Generator) -> Obstacle | None:
    """Beside the lane with its near side in it, or almost."""
    look = str(rng.choice(MOORED))
    side = float(rng.choice([-1.0, 1.0]))
    left_m = side * (0.5 * SIZES[look].width_m + rng.uniform(-0.6, 0.5))
    turn_rad = float(rng.normal(0.0, 0.15)) + float(rng.choice([0.0, math.pi]))
    return _fixed(place, look, place.way.at(place.at_m, left_m, turn_rad), rng)


def _fixed(place: _Place, look: str, pose: Pose2, rng: np.random.Generator) -> Obstacle | None:
    """None where it would touch the bank or something else."""
    size = SIZES[look]
    thing = Obstacle(place.id, *size[:1], look, pose, *size[1:], 0.0, int(rng.integers(12)))
    outline_m = _outline_m(size.length_m, size.width_m, pose)
    world = place.world
    lies_free = meetings.is_afloat(world, outline_m, 0.3) and fixed_gap_m(world.obstacles, outline_m).min() > 0.5
    return thing if lies_free else None


def _outline_m(length_m: float, width_m: float, pose: Pose2) -> F64:
    part, half = np.linspace(-0.5, 0.5, 9), np.full(9, 0.5)
    sides = [np.column_stack(edge) for edge in ((part, -half), (part, half), (-half, part), (half, part))]
    cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    own = np.vstack(sides) * [length_m, width_m]
    return np.asarray(own @ np.array([[cos, sin], [-sin, cos]]) + np.array(pose[:2]))


def _swimmer(place: _Place, rng: np.random.Generator) -> Actor | None:
    turn_rad = float(rng.choice([-1.0, 1.0]) * (0.5 * math.pi + rng.normal(0.0, 0.3)))
    speed_mps = float(rng.uniform(0.2, 0.4))
    run = meetings.crossing(
        place.world, place.way, place.at_m, speed_mps=speed_mps, length_m=1.2, turn_rad=turn_rad, boat_mps=BOAT_MPS
    )
    return _moving(place, "swimming", run, speed_mps, Behaviour.GIVES_WAY, rng)


def _adrift(place: _Place, rng: np.random.Generator) -> Actor | None:
    speed_mps = float(rng.uniform(0.04, 0.18))
    run = meetings.drifting(
        place.world,
        place.way,
        place.at_m,
        speed_mps=speed_mps,
        toward_rad=place.world.wind.toward_rad,
        left_m=float(rng.uniform(-1.2, 1.2)),
        boat_mps=BOAT_MPS,
    )
    return _moving(place, str(rng.choice(ADRIFT)), run, speed_mps, Behaviour.HOLDS_ON, rng)


def _crossing(place: _Place, rng: np.random.Generator) -> Actor | None:
    look = str(rng.choice(UNDER_WAY))
    turn_rad = float(rng.choice([-1.0, 1.0]) * (0.5 * math.pi + rng.normal(0.0, 0.35)))
    speed_mps = float(rng.uniform(0.6, 1.4))
    run = meetings.crossing(
        place.world,
        place.way,
        place.at_m,
        speed_mps=speed_mps,
        length_m=SIZES[look].length_m,
        turn_rad=turn_rad,
        boat_mps=BOAT_MPS,
    )
    return _moving(place, look, run, speed_mps, Behaviour.GIVES_WAY, rng)


def _head_on(place: _Place, rng: np.random.Generator) -> Actor | None:
    speed_mps, left_m = float(rng.uniform(0.5, 1.1)), float(rng.uniform(-1.0, 1.0))
    run = meetings.head_on(place.way, place.at_m, speed_mps=speed_mps, left_m=left_m, boat_mps=BOAT_MPS)
    return _moving(place, str(rng.choice(UNDER_WAY)), run, speed_mps, Behaviour.GIVES_WAY, rng)


def _overtaking(place: _Place, rng: np.random.Generator) -> Actor | None:
    """Most overtake the boat well to its side; some are slower, ahead of it in its lane."""
    slower = rng.random() < 0.4
    speed_mps = float(rng.uniform(0.2, 0.35) if slower else rng.uniform(0.9, 1.4))
    beside_m = float(rng.choice([-1.0, 1.0]) * rng.uniform(2.4, 3.6))
    run = meetings.overtaking(
        place.way,
        place.at_m,
        place.length_m,
        speed_mps=speed_mps,
        left_m=float(rng.uniform(-0.8, 0.8)) if slower else beside_m,
        boat_mps=BOAT_MPS,
    )
    return _moving(place, str(rng.choice(UNDER_WAY)), run, speed_mps, Behaviour.GIVES_WAY, rng)


def _moving(
    place: _Place, look: str, run: Run | None, speed_mps: float, behaviour: Behaviour, rng: np.random.Generator
) -> Actor | None:
    """None without a run, or where its path is not free."""
    if run is None:
        return None
    size = SIZES[look]
    actor = Actor(
        place.id,
        size.kind,
        look,
        run.path_m,
        speed_mps,
        size.length_m,
        size.width_m,
        size.height_m,
        run.start_m,
        int(rng.integers(12)),
        closed=False,
        start_s=run.start_s,
        behaviour=behaviour,
    )
    return actor if meetings.is_free_path(place.world, actor) else None


_DRAWS: tuple[Draw, ...] = (_buoy, _moored, _swimmer, _adrift, _crossing, _head_on, _overtaking)
_CHANCES = (0.22, 0.18, 0.12, 0.12, 0.14, 0.12, 0.10)


def _weathered(world: World, rng: np.random.Generator) -> World:
    """The same water under another sky, in another season and wind, and with other land around it."""
    sky = str(rng.choice(("clear", "cloudy", "overcast", "dusk", "hazy"), p=(0.25, 0.3, 0.2, 0.1, 0.15)))
    kind = rng.choice(("dry", "rain", "fog"), p=(0.7, 0.15, 0.15))
    visibility_m = {"dry": (500.0, 1500.0), "rain": (300.0, 900.0), "fog": (150.0, 400.0)}[str(kind)]
    light = Light(
        sky=sky,
        sun_azimuth_rad=float(rng.uniform(-math.pi, math.pi)),
        sun_elevation_rad=float(rng.uniform(0.08, 0.25) if sky == "dusk" else rng.uniform(0.25, 1.1)),
        visibility_m=float(rng.uniform(*visibility_m)),
        seed=int(rng.integers(1 << 30)),
        rain_mmph=float(rng.uniform(0.5, 8.0)) if kind == "rain" else 0.0,
    )
    wind = Wind(
        speed_mps=float(rng.uniform(0.0, 5.0)),
        toward_rad=float(rng.uniform(-math.pi, math.pi)),
        gust_frac=float(rng.uniform(0.05, 0.35)),
        gust_s=float(rng.uniform(8.0, 20.0)),
    )
    flows = world.channel_m is not None
    return dataclasses.replace(
        world,
        seed=int(rng.integers(1 << 30)),
        wind=wind,
        light=light,
        water_rgb=WATERS[int(rng.integers(len(WATERS)))],
        season_frac=float(rng.beta(0.8, 1.6)),
        waves=Waves(FETCH_M.get(world.name, 100.0)),
        current=Current(float(rng.uniform(0.0, 0.2))) if flows else Current(),
    )
