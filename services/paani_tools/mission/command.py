"""`paani mission send|clear`."""

from __future__ import annotations

import argparse
import asyncio
import sys
from pathlib import Path

from paani import keys
from paani import messages as m
from paani.bus import Bus, open_bus
from paani.cli import add_config_arguments, config_from
from paani.clock import Clock, WallClock
from paani.config import Config
from paani.errors import UserError
from paani.map_origin import map_origin_deg
from paani.mission_client import MISSION_REFUSALS, MissionAnswer, MissionClient
from paani.missions import mission_of_route
from paani.option_paths import input_file
from paani_services.navigator.files.fence_file import load_fence
from paani_services.navigator.files.map_frame import LatLon
from paani_services.navigator.files.mission_file import load_mission
from paani_services.navigator.files.route_file import load_route

CLIENT = "mission"
JOIN_S, POSE_S = 3.0, 1.0


def main(argv: list[str]) -> int:
    """Exit codes: 0 it is in force, 1 nobody answered, 2 the user's mistake or a refusal."""
    options = _parser().parse_args(argv)
    return asyncio.run(_ask(options, config_from(options)))


async def _ask(options: argparse.Namespace, config: Config) -> int:
    clock = WallClock()
    try:
        async with asyncio.timeout(JOIN_S):
            bus = await open_bus(config.bus, CLIENT, clock)
    except TimeoutError:
        raise UserError(f"bus.router {config.bus.router}: no router answers (is the boat's loop up?)") from None
    try:
        return await _ask_on(bus, clock, options, config)
    finally:
        await bus.close()


async def _ask_on(bus: Bus, clock: Clock, options: argparse.Namespace, config: Config) -> int:
    client = MissionClient(bus, clock)
    name, answer, mission = "", None, None
    if options.deed == "clear":
        answer = await client.send(legs=())
    else:
        origin_deg = config.localization.origin_lat_lon_deg or await _origin_of_boat(bus)
        mission, fence = await asyncio.to_thread(_load, options, config, origin_deg)
        name = mission.name
        answer = await client.send(name, legs=mission.legs, fence=fence, rally=mission.rally or None)
    return _tell(answer, "no mission any more" if mission is None else f"{name}: {len(mission.legs)} legs, in force")


def _load(
    options: argparse.Namespace, config: Config, origin_deg: LatLon | None
) -> tuple[m.Mission, tuple[m.FenceArea, ...] | None]:
    """The mission, and the fence where one is given or none is wanted. Raises UserError that names file and field."""
    path: Path = options.mission
    if path.suffix.lower() == ".toml":
        route = load_route(Path(config.navigator.route), origin_deg) if config.navigator.route else None
        mission = load_mission(path, origin_deg, route, "")
    else:
        mission = mission_of_route(load_route(path, origin_deg, ""))
    if options.no_fence:
        return mission, ()
    return mission, None if options.fence is None else load_fence(options.fence, origin_deg, "--fence")


async def _origin_of_boat(bus: Bus) -> LatLon | None:
    """The map's origin as the running boat has it; None where it does not say."""
    poses = bus.latest(keys.ODOMETRY)
    try:
        async with asyncio.timeout(POSE_S):
            while not (pose := await poses.next()).healthy:
                pass
    except TimeoutError:
        return None
    return map_origin_deg(pose)


def _tell(answer: MissionAnswer | None, done: str) -> int:
    """Raises UserError for a refusal."""
    if answer is None:
        sys.stderr.write("NOT IN FORCE: the operator's process does not answer\n")
        return 1
    if answer.refusal is not m.MissionRefusal.NONE:
        raise UserError(f"refused: {answer.fault or MISSION_REFUSALS[answer.refusal]}")
    sys.stdout.write(f"{done}\n")
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="paani mission",
        description="Give a running boat another mission, which it checks first. Nothing begins to move: it is taken "
        "while the boat is not armed or in another mode than ROUTE, another fence while it is not armed or in IDLE.",
    )
    deeds = parser.add_subparsers(dest="deed", required=True, metavar="send|clear")
    send = deeds.add_parser("send", help="put a mission in force")
    send.add_argument(
        "mission", type=input_file(), metavar="FILE", help="a mission (.toml), or a route alone (.gpx, .geojson)"
    )
    fences = send.add_mutually_exclusive_group()
    fences.add_argument("--fence", type=input_file("--fence"), metavar="FILE", help="its fence (else: as it is)")
    fences.add_argument("--no-fence", action="store_true", help="without any fence")
    clear = deeds.add_parser("clear", help="leave the boat without a mission; fence and rally points stay")
    for deed in (send, clear):
        add_config_arguments(deed)
    return parser
