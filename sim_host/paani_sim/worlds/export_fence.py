"""Writes a scenario's water as a fence file: `python -m paani_sim.worlds.export_fence SCENARIO FILE`."""

import sys
from pathlib import Path

from paani.errors import UserError
from paani.whole_file import write_whole
from paani_sim.worlds.load import load_scenario
from paani_sim.worlds.world import World


def fence_toml(world: World) -> str:
    """The water's edge as an area that keeps in (format: `paani_services.navigator.fence_file`), in map metres."""
    corners = "".join(f"  {{x_m = {x_m:.4f}, y_m = {y_m:.4f}}},\n" for x_m, y_m in world.shore_m.tolist())
    return (
        f"[origin]\nlatitude_deg = {world.origin_lat_deg}\nlongitude_deg = {world.origin_lon_deg}\n\n"
        f'[[areas]]\nname = "water"\nkeep = "in"\ncorners = [\n{corners}]\n'
    )


def main(name: str, file: str) -> int:
    """Write the file whole or not at all. Exit code 2, with one line, for a user's mistake."""
    try:
        write_whole(Path(file), fence_toml(load_scenario(name).world).encode())
    except UserError as error:
        sys.stderr.write(f"{error}\n")
        return 2
    return 0


if __name__ == "__main__":
    raise SystemExit(main(*sys.argv[1:3]))
