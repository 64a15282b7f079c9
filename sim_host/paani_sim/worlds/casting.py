"""The things of a scenario file, as obstacles and actors of its world."""

import math

import numpy as np

from paani.arrays import F64
from paani.errors import UserError
from paani_sim.worlds import meetings
from paani_sim.worlds.meetings import BOAT_MPS, Encounter, Run
from paani_sim.worlds.scenario_file import ActorPart
from paani_sim.worlds.sizes import SIZES, Size
from paani_sim.worlds.soundness import check_legs
from paani_sim.worlds.way import Way
from paani_sim.worlds.world import Actor, Obstacle, Pose2, World


def cast(part: ActorPart, world: World, where: str, fallback_id: str) -> Obstacle | Actor:
    """The thing as it stands or runs in the world. `where` names the file and the part in a UserError."""
    if part.look not in SIZES:
        raise UserError(f"{where}.look: unknown {part.look!r} (known: {', '.join(SIZES)})")
    usual = SIZES[part.look]
    size = Size(
        usual.kind, part.length_m or usual.length_m, part.width_m or usual.width_m, part.height_m or usual.height_m
    )
    match part:
        case ActorPart(at_m=tuple(), path_m=None, encounter=None):
            return _standing(part, size, world, where, fallback_id)
        case ActorPart(at_m=None, path_m=tuple(), encounter=None):
            run = Run(_path_m(part, world, where), part.start_m, part.start_s)
        case ActorPart(at_m=None, path_m=None, encounter=Encounter()):
            run = _meeting(part, size, world, where)
        case _:
            raise UserError(f"{where}: needs one of at_m, path_m and encounter")
    if part.speed_mps is None:
        raise UserError(f"{where}.speed_mps: missing, it moves")
    return Actor(
        part.id or fallback_id,
        size.kind,
        part.look,
        run.path_m,
        part.speed_mps,
        size.length_m,
        size.width_m,
        size.height_m,
        run.start_m,
        part.variant,
        closed=part.closed and part.encounter is None,
        start_s=run.start_s,
        behaviour=part.behaviour,
    )


def _standing(part: ActorPart, size: Size, world: World, where: str, fallback_id: str) -> Obstacle:
    pose = _placed(part, world, where, part.at_m or (0.0, 0.0), math.radians(part.heading_deg or 0.0))
    return Obstacle(
        part.id or fallback_id,
        size.kind,
        part.look,
        pose,
        size.length_m,
        size.width_m,
        size.height_m,
        part.base_z_m,
        part.variant,
    )


def _path_m(part: ActorPart, world: World, where: str) -> F64:
    points = part.path_m or ()
    path_m = np.array([_placed(part, world, where, point, 0.0)[:2] for point in points])
    check_legs(path_m, closed=part.closed, where=f"{where}.path_m")
    return path_m


def _placed(part: ActorPart, world: World, where: str, point: tuple[float, float], turn_rad: float) -> Pose2:
    if part.frame == "map":
        return Pose2(*point, turn_rad)
    if part.frame == "route":
        return route_way(world).at(*point, turn_rad)
    if world.channel_m is None:
        raise UserError(f"{where}.frame: the {world.name} has no channel")
    return Way(world.channel_m, closed=False).at(*point, turn_rad)


def route_way(world: World) -> Way:
    """The world's route as a way."""
    return Way(world.route_m, closed=world.route_closed)


def _meeting(part: ActorPart, size: Size, world: World, where: str) -> Run:
    if part.meets_at_m is None or part.speed_mps is None:
        raise UserError(f"{where}: an encounter needs meets_at_m and speed_mps")
    if part.meets_at_m > world.route_length_m:
        raise UserError(f"{where}.meets_at_m: beyond the route's {world.route_length_m:.0f} m")
    way, at_m, speed_mps = route_way(world), part.meets_at_m, part.speed_mps
    heading_rad = None if part.heading_deg is None else math.radians(part.heading_deg)
    run: Run | None
    match part.encounter:
        case Encounter.CROSSING:
            turn_rad = 0.5 * math.pi if heading_rad is None else heading_rad
            run = meetings.crossing(
                world, way, at_m, speed_mps=speed_mps, length_m=size.length_m, turn_rad=turn_rad, boat_mps=BOAT_MPS
            )
        case Encounter.HEAD_ON:
            run = meetings.head_on(way, at_m, speed_mps=speed_mps, left_m=part.left_m, boat_mps=BOAT_MPS)
        case Encounter.OVERTAKING:
            run = meetings.overtaking(
                way, at_m, world.route_length_m, speed_mps=speed_mps, left_m=part.left_m, boat_mps=BOAT_MPS
            )
        case _:
            toward_rad = world.wind.toward_rad if heading_rad is None else way.at(at_m).yaw_rad + heading_rad
            run = meetings.drifting(
                world, way, at_m, speed_mps=speed_mps, toward_rad=toward_rad, left_m=part.left_m, boat_mps=BOAT_MPS
            )
    if run is None:
        raise UserError(f"{where}.meets_at_m: no open water across the route there")
    return run
