"""Scenarios by name: a world, `random:KIND:SEED`, one of `paani_sim/scenarios`, or a TOML file."""

import dataclasses
import math
import re
from pathlib import Path
from typing import TypeVar

import numpy as np

from paani.arrays import F64
from paani.config import WorldConfig
from paani.errors import UserError
from paani.messages import FenceArea, Keep, Waypoint
from paani_sim.vessels import load_vessel
from paani_sim.worlds import WORLDS, load_world
from paani_sim.worlds.curves import circle
from paani_sim.worlds.encounter_paths import NOMINAL_BOAT_MPS
from paani_sim.worlds.faults import Fault
from paani_sim.worlds.generate import draw_random_scenario
from paani_sim.worlds.imazu import IMAZU_SCENARIOS, build_imazu_scenario
from paani_sim.worlds.route_frame import cut_route, start_pose
from paani_sim.worlds.scenario import Scenario, Task
from paani_sim.worlds.scenario_check import check_legs, check_scenario
from paani_sim.worlds.scenario_file import FencePart, RoutePart, ScenarioFile, read_scenario_file
from paani_sim.worlds.scenario_things import build_shoal, build_thing
from paani_sim.worlds.world import Light, Obstacle, World

FOLDER = Path(__file__).parent.parent / "scenarios"
SCENARIOS = tuple(sorted(file.stem for file in FOLDER.glob("*.toml")))
# Beyond what the planner looks at, so that no land has a say; few enough points for a far shore to be drawn.
OPEN_WATER_M, OPEN_WATER_POINTS = 80.0, 96
T = TypeVar("T")
_RANDOM = re.compile(r"random:([a-z]+):(\d{1,9})")


def load_scenario(name_or_path: str | Path) -> Scenario:
    """Raises UserError for a name that is unknown, and one that names file and field for a file that cannot be."""
    name = str(name_or_path)
    if name in WORLDS:
        world = load_world(name)
        return Scenario(name, world, task=Task(0.0, _time_limit_s(world.route_length_m)))
    if drawn := _RANDOM.fullmatch(name):
        return draw_random_scenario(drawn[1], int(drawn[2]))
    if name in IMAZU_SCENARIOS:
        return build_imazu_scenario(name)
    if name in SCENARIOS:
        return _load_file(FOLDER / f"{name}.toml")
    if isinstance(name_or_path, Path) or name.endswith(".toml"):
        return _load_file(Path(name))
    raise UserError(
        f"world: unknown world {name!r} (worlds: {', '.join(WORLDS)}; scenarios: {', '.join(SCENARIOS)}; "
        "random:WORLD:SEED; imazu-01 to imazu-22 and imazu-fair-01 to imazu-fair-22; or a TOML file)"
    )


def configured_scenario(config: WorldConfig) -> Scenario:
    """The configured scenario, with the wind and the seed that the configuration asks for."""
    scenario = load_scenario(config.name)
    if config.wind_mps is not None:
        wind = dataclasses.replace(scenario.world.wind, speed_mps=config.wind_mps)
        scenario = dataclasses.replace(scenario, world=dataclasses.replace(scenario.world, wind=wind))
    return scenario if config.seed is None else dataclasses.replace(scenario, seed=config.seed)


def _time_limit_s(distance_m: float) -> float:
    return 3.0 * distance_m / NOMINAL_BOAT_MPS + 60.0


def _load_file(path: Path) -> Scenario:
    where, file = f"scenario {path}", read_scenario_file(path)
    if file.world.kind not in WORLDS:
        raise UserError(f"{where}: world.kind: unknown {file.world.kind!r} (known: {', '.join(WORLDS)})")
    try:
        load_vessel(file.vessel.profile)
    except UserError as error:
        raise UserError(f"{where}: vessel.profile: {error}") from error
    world = _apply_route(_build_world(file), file.route, where)
    names: dict[str, str] = {}
    for number, part in enumerate(file.actors):
        field = f"actors[{number}]"
        thing = build_thing(part, world, f"{where}: {field}", f"actor_{number}")
        if thing.id in names:
            raise UserError(f"{where}: {field}.id: {thing.id!r} is there twice")
        names[thing.id] = field
        if isinstance(thing, Obstacle):
            world = dataclasses.replace(world, obstacles=(*world.obstacles, thing))
        else:
            world = dataclasses.replace(world, actors=(*world.actors, thing))
    for number, shoal in enumerate(file.depth.shoals):
        built = build_shoal(shoal, world, f"{where}: depth.shoals[{number}]")
        world = dataclasses.replace(world, shoals=(*world.shoals, built))
    distance_m = file.task.distance_m or world.route_length_m
    scenario = Scenario(
        name=path.stem,
        world=world,
        seed=file.seed,
        vessel=file.vessel.profile,
        task=Task(file.task.distance_m or 0.0, file.task.time_limit_s or _time_limit_s(distance_m)),
        faults=tuple(Fault(f.kind, f.start_s, f.duration_s or math.inf, f.amount) for f in file.faults),
        fence=_build_fence(file.fence),
    )
    check_scenario(scenario, where, names)
    if not world.route_closed and distance_m > world.route_length_m + 1e-6:
        raise UserError(f"{where}: task.distance_m: beyond the route's {world.route_length_m:.1f} m")
    return scenario


def _build_world(file: ScenarioFile) -> World:
    """The world with the file's water, light and weather in place of its own."""
    own, part, weather = load_world(file.world.kind), file.world, file.weather
    return dataclasses.replace(
        own,
        seed=_given_or(part.seed, own.seed),
        origin_lat_deg=_given_or(part.origin_lat_deg, own.origin_lat_deg),
        origin_lon_deg=_given_or(part.origin_lon_deg, own.origin_lon_deg),
        water_rgb=_given_or(part.water_rgb, own.water_rgb),
        season_frac=_given_or(part.season_frac, own.season_frac),
        shore_m=own.shore_m if part.banks else _open_water(own),
        obstacles=own.obstacles if part.obstacles else tuple(o for o in own.obstacles if o.look == "bridge"),
        actors=own.actors if part.actors else (),
        bottom_m=_given_or(file.depth.bottom_m, own.bottom_m),
        light=_build_light(file, own.light),
        wind=dataclasses.replace(
            own.wind,
            speed_mps=_given_or(weather.wind_mps, own.wind.speed_mps),
            toward_rad=_radians_or(weather.wind_toward_deg, own.wind.toward_rad),
            gust_frac=_given_or(weather.gust_frac, own.wind.gust_frac),
            gust_s=_given_or(weather.gust_s, own.wind.gust_s),
        ),
        waves=dataclasses.replace(own.waves, fetch_m=_given_or(weather.fetch_m, own.waves.fetch_m)),
        current=dataclasses.replace(
            own.current,
            speed_mps=_given_or(weather.current_mps, own.current.speed_mps),
            toward_rad=_radians_or(weather.current_toward_deg, own.current.toward_rad),
        ),
    )


def _open_water(own: World) -> F64:
    """A round shore that lies `OPEN_WATER_M` outside the corners of the world's own water."""
    low_m, high_m = own.shore_m.min(axis=0), own.shore_m.max(axis=0)
    middle_m = 0.5 * (low_m + high_m)
    radius_m = 0.5 * float(np.hypot(*(high_m - low_m))) + OPEN_WATER_M
    return circle((float(middle_m[0]), float(middle_m[1])), radius_m, OPEN_WATER_POINTS)


def _build_light(file: ScenarioFile, own: Light) -> Light:
    part, weather = file.light, file.weather
    return Light(
        sky=_given_or(part.sky, own.sky),
        sun_azimuth_rad=_radians_or(part.sun_azimuth_deg, own.sun_azimuth_rad),
        sun_elevation_rad=_radians_or(part.sun_elevation_deg, own.sun_elevation_rad),
        visibility_m=_given_or(weather.visibility_m, own.visibility_m),
        seed=_given_or(part.seed, own.seed),
        rain_mmph=_given_or(weather.rain_mmph, own.rain_mmph),
    )


def _apply_route(world: World, part: RoutePart, where: str) -> World:
    if part.waypoints_m is not None:
        if part.from_m is not None or part.length_m is not None:
            raise UserError(f"{where}: route: either waypoints_m or from_m and length_m")
        route_m = np.array(part.waypoints_m)
        check_legs(route_m, closed=part.closed, where=f"{where}: route.waypoints_m")
        return dataclasses.replace(world, route_m=route_m, route_closed=part.closed, start=start_pose(route_m))
    if part.from_m is None and part.length_m is None:
        return world
    if part.from_m is None or part.length_m is None:
        raise UserError(f"{where}: route: from_m and length_m go together")
    if part.length_m > world.route_length_m:
        raise UserError(f"{where}: route.length_m: beyond the {world.name}'s {world.route_length_m:.0f} m")
    return cut_route(world, part.from_m, part.length_m)


def _build_fence(part: FencePart) -> tuple[FenceArea, ...]:
    return tuple(
        FenceArea(keep=keep, corners=tuple(Waypoint(x_m=x_m, y_m=y_m) for x_m, y_m in area))
        for keep, areas in ((Keep.IN, part.keep_in), (Keep.OUT, part.keep_out))
        for area in areas
    )


def _given_or(given: T | None, own: T) -> T:
    return own if given is None else given


def _radians_or(given_deg: float | None, own_rad: float) -> float:
    return own_rad if given_deg is None else math.radians(given_deg)
