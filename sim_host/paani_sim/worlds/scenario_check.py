"""Checks a scenario: route, boat and floating things in the water, clear of each other and inside the fence."""

import re
from collections import Counter

import numpy as np

from paani.arrays import F64
from paani.errors import UserError
from paani.messages import FenceArea, Keep
from paani_sim.vessels import load_vessel
from paani_sim.worlds.bathymetry import find_aground
from paani_sim.worlds.curves import clearance_m, is_inside, sampled_legs
from paani_sim.worlds.passability import footprint_distance_m, obstacle_distance_m
from paani_sim.worlds.scenario import Scenario
from paani_sim.worlds.sizes import is_afloat_by_nature
from paani_sim.worlds.world import Actor, Obstacle, World, actor_pose_at

HULL_RADIUS_M = 0.75  # half the diagonal of a 1.3 x 0.75 m hull
HALF_BEAM_M = 0.375
SAMPLE_M = 0.5
MIN_LEG_M = 0.05
RESERVED_ID = re.compile(r"boat$|(?:bank|hull|keel|shoal)(?:_|$)")  # parts of the model: the boat, land and bottom


def check_scenario(scenario: Scenario, where: str, names: dict[str, str]) -> None:
    """Raises UserError. `where` names the file, `names` the field that a thing's id stands for."""
    world = scenario.world
    things: tuple[Obstacle | Actor, ...] = (*world.obstacles, *world.actors)
    twice = [name for name, count in Counter(thing.id for thing in things).items() if count > 1]
    if twice:
        raise UserError(f"{where}: {names.get(twice[0], 'actors')}.id: {twice[0]!r} is there twice")
    taken = [thing.id for thing in things if RESERVED_ID.match(thing.id)]
    if taken:
        raise UserError(f"{where}: {names.get(taken[0], 'actors')}.id: {taken[0]!r} is a name of the simulator's own")
    for area in scenario.fence:
        _check_area(np.array([(corner.x_m, corner.y_m) for corner in area.corners]), f"{where}: fence.keep_{area.keep}")
    _check_route(world, scenario.fence, where)
    _check_start(world, where)
    _check_afloat(scenario, where)
    for thing in things:
        if thing.id in names:
            _check_thing(world, thing, f"{where}: {names[thing.id]}")


def check_legs(line_m: F64, *, closed: bool, where: str) -> None:
    """Raises UserError for a leg without length, to be called before anything runs along the line."""
    after_m = np.roll(line_m, -1, axis=0) if closed else line_m[1:]
    legs_m = np.linalg.norm(after_m - line_m[: len(after_m)], axis=1)
    if legs_m.min() < MIN_LEG_M:
        raise UserError(f"{where}[{int(np.argmin(legs_m))}] and the next are the same point")


def _check_route(world: World, fence: tuple[FenceArea, ...], where: str) -> None:
    for number, points_m in enumerate(sampled_legs(world.route_m, SAMPLE_M, closed=world.route_closed)):
        on_land = clearance_m(world.shore_m, points_m) < HALF_BEAM_M
        if on_land.any():
            raise UserError(
                f"{where}: route: leg {number} runs over land at {_format_point(points_m[int(np.argmax(on_land))])}"
            )
        outside = ~_is_allowed(fence, points_m)
        if outside.any():
            at = _format_point(points_m[int(np.argmax(outside))])
            raise UserError(f"{where}: route: leg {number} is outside the fence at {at}")


def _check_start(world: World, where: str) -> None:
    here = np.array([world.start[:2]])
    things: tuple[Obstacle | Actor, ...] = (*world.obstacles, *world.actors)
    for thing in things:
        pose = thing.pose if isinstance(thing, Obstacle) else actor_pose_at(thing, 0.0)
        over = isinstance(thing, Obstacle) and not np.isfinite(obstacle_distance_m((thing,), here)[0])
        if not over and footprint_distance_m(thing, pose, here)[0] < HULL_RADIUS_M:
            raise UserError(f"{where}: route: the boat starts inside {thing.id!r}")


def _check_afloat(scenario: Scenario, where: str) -> None:
    start, draught_m = scenario.world.start, load_vessel(scenario.vessel).draught_m
    if scenario.world.bottom_m <= draught_m:
        raise UserError(f"{where}: depth.bottom_m: no deeper than the boat's draught of {draught_m:.2f} m")
    number = find_aground(scenario.world, start.x_m, start.y_m, draught_m, HULL_RADIUS_M)
    if number is not None:
        raise UserError(f"{where}: depth.shoals[{number}]: the boat starts aground on it")


def _check_thing(world: World, thing: Obstacle | Actor, where: str) -> None:
    if isinstance(thing, Obstacle):
        if is_afloat_by_nature(thing) and clearance_m(world.shore_m, np.array([thing.pose[:2]]))[0] < 0.0:
            raise UserError(f"{where}.at_m: {thing.look} on land")
        return
    if not is_afloat_by_nature(thing):
        return
    for number, points_m in enumerate(sampled_legs(thing.path_m, SAMPLE_M, closed=thing.closed)):
        on_land = clearance_m(world.shore_m, points_m) < 0.0
        if on_land.any():
            at = _format_point(points_m[int(np.argmax(on_land))])
            raise UserError(f"{where}: its way runs over land at {at} (leg {number})")


def _check_area(corners_m: F64, where: str) -> None:
    """A simple polygon: no edge meets another but its neighbours'."""
    check_legs(corners_m, closed=True, where=where)
    start, end = corners_m, np.roll(corners_m, -1, axis=0)

    def side(of: F64) -> F64:
        """Left (1) or right (-1) of edge i lies point j, `(edges, points)`."""
        way, rel = (end - start)[:, None], of[None] - start[:, None]
        return np.asarray(np.sign(way[..., 0] * rel[..., 1] - way[..., 1] * rel[..., 0]))

    starts, ends = side(start), side(end)
    apart = starts * ends <= 0.0
    crossing = apart & apart.T
    count = len(corners_m)
    for step in (-1, 0, 1):
        crossing[np.arange(count), (np.arange(count) + step) % count] = False
    if crossing.any():
        one, other = (int(index) for index in np.argwhere(crossing)[0])
        raise UserError(f"{where}: the edges from corners {one} and {other} meet")


def _is_allowed(fence: tuple[FenceArea, ...], points_m: F64) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    within = np.zeros(len(points_m), np.bool_)
    allowed = np.ones(len(points_m), np.bool_)
    for area in fence:
        found = is_inside(np.array([(corner.x_m, corner.y_m) for corner in area.corners]), points_m)
        if area.keep is Keep.IN:
            within |= found
        else:
            allowed &= ~found
    return allowed & within if any(area.keep is Keep.IN for area in fence) else allowed


def _format_point(point: F64) -> str:
    return f"({point[0]:.1f}, {point[1]:.1f}) m"
