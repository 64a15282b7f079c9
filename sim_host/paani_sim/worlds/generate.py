"""Scenarios drawn at random: a stretch of a world's route, one to four encounters on it, light and weather."""

import dataclasses
import math
import zlib
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from paani.arrays import F64
from paani_sim.worlds import WORLDS, encounter_paths, load_world, traffic
from paani_sim.worlds.encounter_paths import NOMINAL_BOAT_MPS, TimedPath
from paani_sim.worlds.meeting_place import MeetingPlace, build_actor
from paani_sim.worlds.passability import PassabilityGrid, obstacle_distance_m
from paani_sim.worlds.route_frame import RouteFrame, cut_route
from paani_sim.worlds.scenario import Scenario, Task
from paani_sim.worlds.shallows import SHALLOWS, SHALLOWS_OF, add_shoals
from paani_sim.worlds.sizes import SIZES
from paani_sim.worlds.waterway import WATERWAY, build_waterway, draw_waterway_light
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
    actor_pose_at,
)

ROUTE_LENGTH_RANGE_M = (35.0, 60.0)
MIN_PASSAGE_M = 3.0  # width of the gap that must lead on at any time
ENCOUNTER_SPACING_M = 8.0  # between the places of two encounters
END_CLEARANCE_M = 4.0
GOAL_CLEARANCE_M = 8.0  # no encounter is nearer to the goal, and no obstacle nearer behind it
MAX_ENCOUNTERS = 4
MAX_TRIES = 60
DRAWN_WORLDS = (*WORLDS, SHALLOWS)  # the suites of trials drive in `WORLDS` alone
FETCH_M = {"lake": 200.0, "river": 80.0, "canal": 40.0, "harbour": 120.0}
WATER_COLOURS_RGB = ((0.30, 0.34, 0.22), (0.40, 0.36, 0.24), (0.20, 0.28, 0.26), (0.16, 0.24, 0.30), (0.46, 0.42, 0.32))
BUOYS = ("can", "cone", "sphere", "pillar", "spar")
MOORED = ("rowboat", "dinghy", "cruiser", "workboat", "sailboat", "barge")
UNDER_WAY = ("dinghy", "kayak", "cruiser", "workboat")
ADRIFT = ("rowboat", "dinghy", "kayak")


class Traffic(NamedTuple):
    """What is met on a drawn route. encounters: how many are wanted, None for 1 to 4 as the seed draws.

    people_factor: how many times as often as else it is a swimmer, a kayak or a paddle board.
    """

    encounters: int | None = None
    people_factor: int = 1


class Section(NamedTuple):
    """A stretch of a world: the world cut to it, its route, length, and what of it is passable."""

    world: World
    route: RouteFrame
    length_m: float
    lattice: PassabilityGrid


AS_DRAWN = Traffic()
DrawThing = Callable[[MeetingPlace, np.random.Generator], Obstacle | Actor | None]
DrawEncounter = Callable[[MeetingPlace, np.random.Generator], Sequence[Obstacle | Actor]]


def draw_random_scenario(kind: str, seed: int, met: Traffic = AS_DRAWN) -> Scenario:
    """The scenario of one of `DRAWN_WORLDS` and a seed (0 or more), always the same. Raises UserError for another.

    The boat follows an open stretch of the world's route. Whatever is met, a gap of 3 m leads on at any time.
    """
    rng = np.random.default_rng([zlib.crc32(kind.encode()), seed])
    if kind == SHALLOWS:
        return _draw_shallows(seed, rng)
    world: World
    draw: DrawEncounter
    if kind == WATERWAY:
        world, draw = build_waterway(seed), traffic.draw_encounter
    else:
        world, draw = _draw_weather(load_world(kind), rng), _draw_encounter
    world = dataclasses.replace(world, actors=())
    while True:
        found = _draw_route_with_encounters(world, draw, met, rng)
        if found is not None:
            break
    if kind == WATERWAY:
        found = dataclasses.replace(found, light=draw_waterway_light(seed, found.start.yaw_rad))
    return _follow_route(found, kind, seed)


def _draw_shallows(seed: int, rng: np.random.Generator) -> Scenario:
    """Shoals alone are met, so that nothing else decides how a drive ends."""
    own = _draw_weather(load_world(str(rng.choice(SHALLOWS_OF))), rng)
    water = dataclasses.replace(own, actors=())
    while True:
        section = _draw_section(water, rng)
        found = None if section is None else add_shoals(*section, rng)
        if found is not None:
            return _follow_route(found, SHALLOWS, seed)


def _follow_route(found: World, kind: str, seed: int) -> Scenario:
    length_m = found.route_length_m
    return Scenario(
        name=f"random:{kind}:{seed}",
        world=found,
        seed=seed,
        task=Task(distance_m=length_m, time_limit_s=3.0 * length_m / NOMINAL_BOAT_MPS + 60.0),
    )


def _draw_route_with_encounters(
    world: World, draw: DrawEncounter, met: Traffic, rng: np.random.Generator
) -> World | None:
    """A stretch somewhere along the route with at least one encounter, or None where it does not work out."""
    found = _draw_section(world, rng)
    if found is None:
        return None
    section, route, length_m, lattice = found
    drawn, meetings_m = int(rng.integers(1, MAX_ENCOUNTERS + 1)), list[float]()
    wanted = met.encounters or drawn
    for number in range(MAX_TRIES):
        at_m = float(rng.uniform(10.0, length_m - GOAL_CLEARANCE_M))
        if any(abs(at_m - other_m) < ENCOUNTER_SPACING_M for other_m in meetings_m):
            continue
        things = draw(MeetingPlace(section, route, length_m, at_m, f"met_{number}", met.people_factor), rng)
        candidate = _add_things(section, things)
        if (
            things
            and all(_is_clear_of_start(section, thing) for thing in things)
            and all(encounter_paths.is_path_clear(candidate, actor) for actor in section.actors)
            and lattice.is_passable(candidate.obstacles, candidate.actors, MIN_PASSAGE_M, NOMINAL_BOAT_MPS)
        ):
            section = candidate
            meetings_m.append(at_m)
            if len(meetings_m) == wanted:
                break
    return section if meetings_m else None


def _draw_section(world: World, rng: np.random.Generator) -> Section | None:
    """A stretch somewhere along the route that leads past what lies there, or None where it does not work out."""
    from_m, length_m = rng.uniform(0.0, world.route_length_m), rng.uniform(*ROUTE_LENGTH_RANGE_M)
    route = RouteFrame(world.route_m, closed=world.route_closed, first_m=from_m)
    section = cut_route(world, from_m, length_m)
    lattice = PassabilityGrid(section, route, length_m)
    start_gap_m = obstacle_distance_m(section.obstacles, np.array([section.start[:2]]))[0]
    goal_gap_m = obstacle_distance_m(section.obstacles, route.line_m(length_m, length_m + GOAL_CLEARANCE_M)).min()
    if min(start_gap_m, goal_gap_m) < END_CLEARANCE_M or not lattice.is_passable(
        section.obstacles, (), MIN_PASSAGE_M, NOMINAL_BOAT_MPS
    ):
        return None
    return Section(section, route, length_m, lattice)


def _draw_encounter(place: MeetingPlace, rng: np.random.Generator) -> Sequence[Obstacle | Actor]:
    """One of the things of the worlds whose layout is fixed; none where it does not work out."""
    shares = np.array(_SHARES) * [place.people_factor if kind is _draw_swimmer else 1 for kind in _KINDS]
    thing = _KINDS[int(rng.choice(len(_KINDS), p=shares / shares.sum()))](place, rng)
    return () if thing is None else (thing,)


def _add_things(world: World, things: Sequence[Obstacle | Actor]) -> World:
    still = tuple(thing for thing in things if isinstance(thing, Obstacle))
    moving = tuple(thing for thing in things if isinstance(thing, Actor))
    return dataclasses.replace(world, obstacles=(*world.obstacles, *still), actors=(*world.actors, *moving))


def _is_clear_of_start(world: World, thing: Obstacle | Actor) -> bool:
    pose = thing.pose if isinstance(thing, Obstacle) else actor_pose_at(thing, 0.0)
    gap_m = math.hypot(pose.x_m - world.start.x_m, pose.y_m - world.start.y_m)
    return gap_m - 0.5 * thing.length_m > END_CLEARANCE_M


def _draw_buoy(place: MeetingPlace, rng: np.random.Generator) -> Obstacle | None:
    return _place_obstacle(place, str(rng.choice(BUOYS)), place.route.pose_at(place.at_m, rng.uniform(-1.2, 1.2)), rng)


def _draw_moored(place: MeetingPlace, rng: np.random.Generator) -> Obstacle | None:
    """Beside the lane with its near side in it, or almost."""
    look = str(rng.choice(MOORED))
    side = float(rng.choice([-1.0, 1.0]))
    left_m = side * (0.5 * SIZES[look].width_m + rng.uniform(-0.6, 0.5))
    turn_rad = float(rng.normal(0.0, 0.15)) + float(rng.choice([0.0, math.pi]))
    return _place_obstacle(place, look, place.route.pose_at(place.at_m, left_m, turn_rad), rng)


def _place_obstacle(place: MeetingPlace, look: str, pose: Pose2, rng: np.random.Generator) -> Obstacle | None:
    """None where it would touch the bank or something else."""
    size = SIZES[look]
    thing = Obstacle(place.id, *size[:1], look, pose, *size[1:], 0.0, int(rng.integers(12)))
    outline_m = _outline_m(size.length_m, size.width_m, pose)
    world = place.world
    lies_free = (
        encounter_paths.is_afloat(world, outline_m, 0.3) and obstacle_distance_m(world.obstacles, outline_m).min() > 0.5
    )
    return thing if lies_free else None


def _outline_m(length_m: float, width_m: float, pose: Pose2) -> F64:
    part, half = np.linspace(-0.5, 0.5, 9), np.full(9, 0.5)
    sides = [np.column_stack(edge) for edge in ((part, -half), (part, half), (-half, part), (half, part))]
    cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    own = np.vstack(sides) * [length_m, width_m]
    return np.asarray(own @ np.array([[cos, sin], [-sin, cos]]) + np.array(pose[:2]))


def _draw_swimmer(place: MeetingPlace, rng: np.random.Generator) -> Actor | None:
    turn_rad = float(rng.choice([-1.0, 1.0]) * (0.5 * math.pi + rng.normal(0.0, 0.3)))
    speed_mps = float(rng.uniform(0.2, 0.4))
    timed_path = encounter_paths.plan_crossing(
        place.world,
        place.route,
        place.at_m,
        speed_mps=speed_mps,
        length_m=1.2,
        turn_rad=turn_rad,
        boat_mps=NOMINAL_BOAT_MPS,
    )
    return _build_sized(place, "swimming", timed_path, speed_mps, Behaviour.GIVES_WAY, rng)


def _draw_adrift(place: MeetingPlace, rng: np.random.Generator) -> Actor | None:
    speed_mps = float(rng.uniform(0.04, 0.18))
    timed_path = encounter_paths.plan_drifting(
        place.world,
        place.route,
        place.at_m,
        speed_mps=speed_mps,
        toward_rad=place.world.wind.toward_rad,
        left_m=float(rng.uniform(-1.2, 1.2)),
        boat_mps=NOMINAL_BOAT_MPS,
    )
    return _build_sized(place, str(rng.choice(ADRIFT)), timed_path, speed_mps, Behaviour.HOLDS_ON, rng)


def _draw_look_under_way(place: MeetingPlace, rng: np.random.Generator) -> str:
    return str(rng.choice(UNDER_WAY + (place.people_factor - 1) * ("kayak",)))


def _draw_crossing(place: MeetingPlace, rng: np.random.Generator) -> Actor | None:
    look = _draw_look_under_way(place, rng)
    turn_rad = float(rng.choice([-1.0, 1.0]) * (0.5 * math.pi + rng.normal(0.0, 0.35)))
    speed_mps = float(rng.uniform(0.6, 1.4))
    timed_path = encounter_paths.plan_crossing(
        place.world,
        place.route,
        place.at_m,
        speed_mps=speed_mps,
        length_m=SIZES[look].length_m,
        turn_rad=turn_rad,
        boat_mps=NOMINAL_BOAT_MPS,
    )
    return _build_sized(place, look, timed_path, speed_mps, Behaviour.GIVES_WAY, rng)


def _draw_head_on(place: MeetingPlace, rng: np.random.Generator) -> Actor | None:
    speed_mps, left_m = float(rng.uniform(0.5, 1.1)), float(rng.uniform(-1.0, 1.0))
    timed_path = encounter_paths.plan_head_on(
        place.route, place.at_m, speed_mps=speed_mps, left_m=left_m, boat_mps=NOMINAL_BOAT_MPS
    )
    return _build_sized(place, _draw_look_under_way(place, rng), timed_path, speed_mps, Behaviour.GIVES_WAY, rng)


def _draw_overtaking(place: MeetingPlace, rng: np.random.Generator) -> Actor | None:
    """Most overtake the boat well to its side; some are slower, ahead of it in its lane."""
    slower = rng.random() < 0.4
    speed_mps = float(rng.uniform(0.2, 0.35) if slower else rng.uniform(0.9, 1.4))
    beside_m = float(rng.choice([-1.0, 1.0]) * rng.uniform(2.4, 3.6))
    timed_path = encounter_paths.plan_overtaking(
        place.route,
        place.at_m,
        place.length_m,
        speed_mps=speed_mps,
        left_m=float(rng.uniform(-0.8, 0.8)) if slower else beside_m,
        boat_mps=NOMINAL_BOAT_MPS,
    )
    return _build_sized(place, _draw_look_under_way(place, rng), timed_path, speed_mps, Behaviour.GIVES_WAY, rng)


def _build_sized(
    place: MeetingPlace,
    look: str,
    timed_path: TimedPath | None,
    speed_mps: float,
    behaviour: Behaviour,
    rng: np.random.Generator,
) -> Actor | None:
    return build_actor(place, look, SIZES[look], timed_path, speed_mps, behaviour, rng)


_KINDS: tuple[DrawThing, ...] = (
    _draw_buoy,
    _draw_moored,
    _draw_swimmer,
    _draw_adrift,
    _draw_crossing,
    _draw_head_on,
    _draw_overtaking,
)
_SHARES = (0.22, 0.18, 0.12, 0.12, 0.14, 0.12, 0.10)


def _draw_weather(world: World, rng: np.random.Generator) -> World:
    """Draw sky, season, wind and land around the same water."""
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
        water_rgb=WATER_COLOURS_RGB[int(rng.integers(len(WATER_COLOURS_RGB)))],
        season_frac=float(rng.beta(0.8, 1.6)),
        waves=Waves(FETCH_M.get(world.name, 100.0)),
        current=Current(float(rng.uniform(0.0, 0.2))) if flows else Current(),
    )
