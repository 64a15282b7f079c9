"""Writes a scenario's water as a fence file: `python -m paani_sim.worlds.export_fence SCENARIO FILE`."""

import json
import sys
from collections.abc import Iterable
from pathlib import Path

from paani.errors import UserError
from paani.messages import FenceArea, Keep, Waypoint
from paani.whole_file import write_whole
from paani_sim.worlds.load import load_scenario
from paani_sim.worlds.world import World


def fence_toml(world: World, areas: Iterable[FenceArea]) -> str:
    """The fence file of areas in the world's map (format: `paani_services.navigator.files.fence_file`)."""
    head = f"[origin]\nlatitude_deg = {world.origin_lat_deg}\nlongitude_deg = {world.origin_lon_deg}\n"
    parts = []
    for area in areas:
        corners = "".join(f"  {{x_m = {corner.x_m:.4f}, y_m = {corner.y_m:.4f}}},\n" for corner in area.corners)
        parts.append(
            f'\n[[areas]]\nname = {json.dumps(area.name)}\nkeep = "{area.keep.value}"\ncorners = [\n{corners}]\n'
        )
    return head + "".join(parts)


def water_area(world: World) -> FenceArea:
    """The water's edge as an area that keeps in."""
    corners = tuple(Waypoint(x_m=x_m, y_m=y_m) for x_m, y_m in world.shore_m.tolist())
    return FenceArea(keep=Keep.IN, corners=corners, name="water")


def main(name: str, file: str) -> int:
    """Write the file whole or not at all. Exit code 2, with one line, for a user's mistake."""
    try:
        world = load_scenario(name).world
        write_whole(Path(file), fence_toml(world, [water_area(world)]).encode())
    except UserError as error:
        sys.stderr.write(f"{error}\n")
        return 2
    return 0


if __name__ == "__main__":
    raise SystemExit(main(*sys.argv[1:3]))
