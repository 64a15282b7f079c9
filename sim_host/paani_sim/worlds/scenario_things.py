"""Builds the things of a scenario file as obstacles and actors of its world."""

import math

import numpy as np

from paani.arrays import F64
from paani.errors import UserError
from paani_sim.worlds import encounter_paths
from paani_sim.worlds.encounter_paths import NOMINAL_BOAT_MPS, Encounter, TimedPath
from paani_sim.worlds.route_frame import RouteFrame
from paani_sim.worlds.scenario_check import check_legs
from paani_sim.worlds.scenario_file import ActorPart, ShoalPart
from paani_sim.worlds.sizes import SIZES, Size
from paani_sim.worlds.world import Actor, Obstacle, Pose2, Shoal, World


def build_thing(part: ActorPart, world: World, where: str, fallback_id: str) -> Obstacle | Actor:
    """Build one thing in its world. `where` names the file and the part in a UserError."""
    if part.look not in SIZES:
        raise UserError(f"{where}.look: unknown {part.look!r} (known: {', '.join(SIZES)})")
    usual = SIZES[part.look]
    size = Size(
        usual.kind, part.length_m or usual.length_m, part.width_m or usual.width_m, part.height_m or usual.height_m
    )
    match part:
        case ActorPart(at_m=tuple(), path_m=None, encounter=None):
            return _build_obstacle(part, size, world, where, fallback_id)
        case ActorPart(at_m=None, path_m=tuple(), encounter=None):
            timed_path = TimedPath(_path_m(part, world, where), part.start_m, part.start_s)
        case ActorPart(at_m=None, path_m=None, encounter=Encounter()):
            timed_path = _plan_encounter(part, size, world, where)
        case _:
            raise UserError(f"{where}: needs one of at_m, path_m and encounter")
    if part.speed_mps is None:
        raise UserError(f"{where}.speed_mps: missing, it moves")
    return Actor(
        part.id or fallback_id,
        size.kind,
        part.look,
        timed_path.path_m,
        part.speed_mps,
        size.length_m,
        size.width_m,
        size.height_m,
        timed_path.start_m,
        part.variant,
        closed=part.closed and part.encounter is None,
        start_s=timed_path.start_s,
        behaviour=part.behaviour,
    )


def build_shoal(part: ShoalPart, world: World, where: str) -> Shoal:
    """Build one shoal in its world. `where` names the file and the part in a UserError."""
    if part.top_m >= world.bottom_m:
        raise UserError(f"{where}.top_m: {part.top_m:g} m is not above the bottom at {world.bottom_m:g} m")
    return Shoal(*_locate(part, world, where, part.at_m, 0.0)[:2], part.radius_m, part.top_m)


def _build_obstacle(part: ActorPart, size: Size, world: World, where: str, fallback_id: str) -> Obstacle:
    pose = _locate(part, world, where, part.at_m or (0.0, 0.0), math.radians(part.heading_deg or 0.0))
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
    path_m = np.array([_locate(part, world, where, point, 0.0)[:2] for point in points])
    check_legs(path_m, closed=part.closed, where=f"{where}.path_m")
    return path_m


def _locate(
    part: ActorPart | ShoalPart, world: World, where: str, point: tuple[float, float], turn_rad: float
) -> Pose2:
    if part.frame == "map":
        return Pose2(*point, turn_rad)
    if part.frame == "route":
        return world_route_frame(world).pose_at(*point, turn_rad)
    if world.channel_m is None:
        raise UserError(f"{where}.frame: the {world.name} has no channel")
    return RouteFrame(world.channel_m, closed=False).pose_at(*point, turn_rad)


def world_route_frame(world: World) -> RouteFrame:
    """Coordinates along the world's route."""
    return RouteFrame(world.route_m, closed=world.route_closed)


def _plan_encounter(part: ActorPart, size: Size, world: World, where: str) -> TimedPath:
    if part.meets_at_m is None or part.speed_mps is None:
        raise UserError(f"{where}: an encounter needs meets_at_m and speed_mps")
    if part.meets_at_m > world.route_length_m:
        raise UserError(f"{where}.meets_at_m: beyond the route's {world.route_length_m:.0f} m")
    route, at_m, speed_mps = world_route_frame(world), part.meets_at_m, part.speed_mps
    heading_rad = None if part.heading_deg is None else math.radians(part.heading_deg)
    timed_path: TimedPath | None
    match part.encounter:
        case Encounter.CROSSING:
            turn_rad = 0.5 * math.pi if heading_rad is None else heading_rad
            timed_path = encounter_paths.plan_crossing(
                world,
                route,
                at_m,
                speed_mps=speed_mps,
                length_m=size.length_m,
                turn_rad=turn_rad,
                boat_mps=NOMINAL_BOAT_MPS,
            )
        case Encounter.HEAD_ON:
            timed_path = encounter_paths.plan_head_on(
                route, at_m, speed_mps=speed_mps, left_m=part.left_m, boat_mps=NOMINAL_BOAT_MPS
            )
        case Encounter.OVERTAKING:
            timed_path = encounter_paths.plan_overtaking(
                route, at_m, world.route_length_m, speed_mps=speed_mps, left_m=part.left_m, boat_mps=NOMINAL_BOAT_MPS
            )
        case _:
            toward_rad = world.wind.toward_rad if heading_rad is None else route.pose_at(at_m).yaw_rad + heading_rad
            timed_path = encounter_paths.plan_drifting(
                world,
                route,
                at_m,
                speed_mps=speed_mps,
                toward_rad=toward_rad,
                left_m=part.left_m,
                boat_mps=NOMINAL_BOAT_MPS,
            )
    if timed_path is None:
        raise UserError(f"{where}.meets_at_m: no open water across the route there")
    return timed_path
