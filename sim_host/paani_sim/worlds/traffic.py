"""A catalogue of who moves on a waterway, and how one of them, or a group, is met. Pure.

Who sees the boat gives way or, as birds do, hurries away. Who does not holds on, and is met so that a boat on its route
is not run into: rowers face aft, a bargee sees nothing close ahead of the bow. They come along the channel's middle, or
cross it before the boat is there.
"""

import dataclasses
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from paani.arrays import F64
from paani_sim.worlds import encounter_paths
from paani_sim.worlds.encounter_paths import NOMINAL_BOAT_MPS, Encounter, TimedPath
from paani_sim.worlds.footprint import build_outline, is_apart, place_outline
from paani_sim.worlds.meeting_place import MeetingPlace, build_actor
from paani_sim.worlds.passability import HEADROOM_M, footprint_distance_m
from paani_sim.worlds.sizes import SIZES, Size
from paani_sim.worlds.world import Actor, Behaviour, Obstacle, actor_pose_at

CROSSING, HEAD_ON, OVERTAKING, DRIFTING = Encounter
UNDER_WAY = (CROSSING, HEAD_ON, OVERTAKING)
UNSEEING_GAP_M = (2.0, 4.5)  # between the side of who does not see the boat and the route's line
SEEING_GAP_M = (1.2, 2.4)  # between the side of who overtakes and sees the boat, and the route's line
AHEAD_GAP_M = 2.0  # left between a boat on its route and who crosses before it without seeing it
BOAT_ROOM_M = 1.2  # from the boat's middle to the side of who does not see it
TRIES = 12  # at one place, or what is long and wide would hardly ever be met
START_GAP_M = 0.3  # at least, from what starts to shore, obstacles and others


class ActorKind(NamedTuple):
    """One kind of actor: how often, what it looks like, its size over the look's usual, speed, how it is met, group.

    `seeing`: the share that sees the boat. `reaction`: what those do. `group`: least and most. `apart_m`: between its
    members. `turn_deg`: mean and standard deviation of a crossing's angle to the boat's course, to either side.
    """

    weight: float
    looks: tuple[str, ...]
    scale: tuple[float, float]
    speed_mps: tuple[float, float]
    encounters: tuple[Encounter, ...]
    seeing: float
    reaction: Behaviour = Behaviour.GIVES_WAY
    group: tuple[int, int] = (1, 1)
    apart_m: float = 0.0
    turn_deg: tuple[float, float] = (90.0, 17.0)


ACTOR_KINDS = {
    "motor_boat": ActorKind(0.10, ("dinghy", "cruiser", "workboat"), (0.9, 1.2), (0.6, 1.8), UNDER_WAY, 0.9),
    "kayaks": ActorKind(0.10, ("kayak",), (0.9, 1.1), (0.7, 1.5), UNDER_WAY, 0.9, group=(1, 3), apart_m=3.5),
    "paddle_boards": ActorKind(
        0.09, ("paddleboard",), (0.9, 1.1), (0.4, 1.0), UNDER_WAY, 0.85, group=(1, 3), apart_m=3.0
    ),
    "rowing_eight": ActorKind(0.12, ("eight",), (0.95, 1.0), (1.8, 3.2), (HEAD_ON, OVERTAKING), 0.0),
    "barge": ActorKind(0.10, ("barge", "narrowboat"), (1.1, 1.8), (0.9, 2.2), (HEAD_ON, OVERTAKING), 0.3),
    "ferry": ActorKind(0.14, ("ferry",), (0.85, 1.1), (0.8, 1.6), (CROSSING,), 0.4, turn_deg=(142.0, 8.0)),
    "jet_ski": ActorKind(0.08, ("jetski",), (0.9, 1.1), (1.6, 2.8), UNDER_WAY, 0.8),
    "swimmers": ActorKind(0.11, ("swimming",), (1.0, 1.0), (0.2, 0.4), (CROSSING,), 0.8, group=(1, 4), apart_m=2.2),
    "dog": ActorKind(0.06, ("dog",), (0.8, 1.1), (0.3, 0.7), (CROSSING,), 1.0),
    "birds": ActorKind(0.08, ("swan", "duck"), (0.9, 1.1), (0.1, 0.35), (CROSSING,), 1.0, Behaviour.FLEES, (2, 4), 1.6),
    "log": ActorKind(0.06, ("log",), (0.7, 1.5), (0.04, 0.18), (DRIFTING,), 0.0),
    "adrift": ActorKind(0.06, ("rowboat", "dinghy", "kayak"), (0.9, 1.1), (0.04, 0.18), (DRIFTING,), 0.0),
}


PEOPLE = ("swimmers", "kayaks", "paddle_boards")


class _Meeting(NamedTuple):
    """What a group's members have in common."""

    place: MeetingPlace
    encounter: Encounter
    behaviour: Behaviour
    speed_mps: float
    turn_rad: float
    left_m: float


def draw_encounter(place: MeetingPlace, rng: np.random.Generator) -> Sequence[Obstacle | Actor]:
    """One actor of the catalogue, or a group; none where it does not work out there."""
    factor = place.people_factor
    weights = np.array([kind.weight * (factor if name in PEOPLE else 1) for name, kind in ACTOR_KINDS.items()])
    chosen = str(rng.choice(list(ACTOR_KINDS), p=weights / weights.sum()))
    for _ in range(TRIES):
        if found := draw_actors(chosen, place, rng):
            return found
    return ()


def draw_actors(name: str, place: MeetingPlace, rng: np.random.Generator) -> Sequence[Actor]:
    """An actor of this kind, or a group; none where it does not work out there."""
    kind = ACTOR_KINDS[name]
    look, count = str(rng.choice(kind.looks)), int(rng.integers(kind.group[0], kind.group[1] + 1))
    encounter = kind.encounters[int(rng.integers(len(kind.encounters)))]
    sees, factor = bool(rng.random() < kind.seeing), float(rng.uniform(*kind.scale))
    size = SIZES[look].scaled(factor)
    meeting = _Meeting(
        place,
        encounter,
        kind.reaction if sees else Behaviour.HOLDS_ON,
        float(rng.uniform(*kind.speed_mps)),
        math.radians(float(rng.choice([-1.0, 1.0]) * rng.normal(*kind.turn_deg))),
        _draw_left_m(encounter, size, rng, sees=sees),
    )
    unseeing = meeting.behaviour is Behaviour.HOLDS_ON and encounter is not DRIFTING
    found: list[Actor] = []
    for number in range(count):
        there = dataclasses.replace(
            place,
            at_m=place.at_m + number * kind.apart_m,
            id=place.id if count == 1 else f"{place.id}_{number}",
        )
        if there.at_m > place.length_m:
            break
        timed_path = _plan(meeting._replace(place=there), size)
        if timed_path is not None and encounter in {HEAD_ON, OVERTAKING}:
            speed_mps, width_m = meeting.speed_mps, size.width_m
            timed_path = encounter_paths.trim_to_clear(place.world, timed_path, speed_mps, there.at_m, width_m)
        actor = build_actor(there, look, size, timed_path, meeting.speed_mps, meeting.behaviour, rng)
        if actor is None or not _starts_free(place, actor, found) or (unseeing and not _misses_boat(place, actor)):
            break
        found.append(actor)
    return found


def _draw_left_m(encounter: Encounter, size: Size, rng: np.random.Generator, *, sees: bool) -> float:
    """How far to the left of the route a thing is met: there is the middle of the channel."""
    half_m, near_m, mid_m = 0.5 * size.width_m, float(rng.uniform(*SEEING_GAP_M)), float(rng.uniform(*UNSEEING_GAP_M))
    centred_m, side = float(rng.uniform(-1.0, 1.0)), float(rng.choice([-1.0, 1.0]))
    if encounter in (CROSSING, DRIFTING):
        return centred_m
    if not sees:
        return half_m + mid_m
    return centred_m if encounter is HEAD_ON else side * (half_m + near_m)


def _plan(meeting: _Meeting, size: Size) -> TimedPath | None:
    place, speed_mps = meeting.place, meeting.speed_mps
    world, route, at_m = place.world, place.route, place.at_m
    is_unseeing = meeting.behaviour is Behaviour.HOLDS_ON
    match meeting.encounter:
        case Encounter.CROSSING:
            return encounter_paths.plan_crossing(
                world,
                route,
                at_m,
                speed_mps=speed_mps,
                length_m=size.length_m,
                turn_rad=meeting.turn_rad,
                boat_mps=_early_mps(at_m, size, speed_mps) if is_unseeing else NOMINAL_BOAT_MPS,
            )
        case Encounter.HEAD_ON:
            return encounter_paths.plan_head_on(
                route, at_m, speed_mps=speed_mps, left_m=meeting.left_m, boat_mps=NOMINAL_BOAT_MPS
            )
        case Encounter.OVERTAKING:
            return encounter_paths.plan_overtaking(
                route, at_m, place.length_m, speed_mps=speed_mps, left_m=meeting.left_m, boat_mps=NOMINAL_BOAT_MPS
            )
    return encounter_paths.plan_drifting(
        world,
        route,
        at_m,
        speed_mps=speed_mps,
        toward_rad=_downstream_rad(place),
        left_m=meeting.left_m,
        boat_mps=NOMINAL_BOAT_MPS,
    )


def _early_mps(at_m: float, size: Size, speed_mps: float) -> float:
    """Speed of a boat that would be there as much sooner as it takes to cross before ours and leave it room."""
    room_m = 0.5 * size.width_m + AHEAD_GAP_M + NOMINAL_BOAT_MPS * 0.5 * size.length_m / speed_mps
    return NOMINAL_BOAT_MPS * at_m / max(at_m - room_m, 1.0)


def _downstream_rad(place: MeetingPlace) -> float:
    """The way of the channel where it is nearest, or of the wind where there is none."""
    channel_m = place.world.channel_m
    if channel_m is None:
        return place.world.wind.toward_rad
    here = np.array(place.route.pose_at(place.at_m)[:2])
    nearest = min(int(np.argmin(np.hypot(*(channel_m - here).T))), len(channel_m) - 2)
    east_m, north_m = channel_m[nearest + 1] - channel_m[nearest]
    return math.atan2(float(north_m), float(east_m))


def _starts_free(place: MeetingPlace, actor: Actor, group: Sequence[Actor]) -> bool:
    """Whether its outline lies in the water and clear of everything at the start."""
    outline_m = _start_outline_m(actor)
    if not encounter_paths.is_afloat(place.world, outline_m, START_GAP_M):
        return False
    others_m = [_start_outline_m(other) for other in (*place.world.actors, *group)]
    low = (thing for thing in place.world.obstacles if thing.base_z_m <= HEADROOM_M)
    others_m += [place_outline(build_outline(thing), thing.pose) for thing in low]
    return all(is_apart(outline_m, other_m, START_GAP_M) for other_m in others_m)


def _misses_boat(place: MeetingPlace, actor: Actor) -> bool:
    """Whether a boat that goes along its route at its usual speed is left room at all times."""
    times_s = np.arange(0.0, place.length_m / NOMINAL_BOAT_MPS, 0.5).tolist()
    return all(
        footprint_distance_m(
            actor, actor_pose_at(actor, t_s), np.array([place.route.pose_at(NOMINAL_BOAT_MPS * t_s)[:2]])
        )[0]
        > BOAT_ROOM_M
        for t_s in times_s
    )


def _start_outline_m(actor: Actor) -> F64:
    return place_outline(build_outline(actor), actor_pose_at(actor, 0.0))
