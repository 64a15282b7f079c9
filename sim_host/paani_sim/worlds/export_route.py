"""Writes a scenario's route, and its fence where it has one; run as a module: SCENARIO ROUTE_FILE FENCE_FILE."""

import json
import sys
from pathlib import Path

from paani.errors import UserError
from paani.whole_file import write_whole
from paani_sim.worlds.export_fence import fence_toml
from paani_sim.worlds.load import load_scenario
from paani_sim.worlds.world import World


def route_toml(world: World, name: str) -> str:
    """The route file of the world (format: `paani_services.navigator.files.route_file`), in map metres."""
    head = (
        f"name = {json.dumps(name[-100:])}\nrepeat = {json.dumps(world.route_closed)}\n\n[origin]\n"
        f"latitude_deg = {world.origin_lat_deg}\nlongitude_deg = {world.origin_lon_deg}\n"
    )
    points = (f"\n[[waypoints]]\nx_m = {x_m:.4f}\ny_m = {y_m:.4f}\n" for x_m, y_m in world.route_m.tolist())
    return head + "".join(points)


def main(name: str, route: str, fence: str) -> int:
    """Write each file whole or not at all. Exit code 2, with one line, for a user's mistake."""
    try:
        scenario = load_scenario(name)
        write_whole(Path(route), route_toml(scenario.world, scenario.name).encode())
        if scenario.fence:
            write_whole(Path(fence), fence_toml(scenario.world, scenario.fence).encode())
    except UserError as error:
        sys.stderr.write(f"{error}\n")
        return 2
    return 0


if __name__ == "__main__":
    raise SystemExit(main(*sys.argv[1:4]))
