"""Writes a world's route as a route file: `python -m paani_sim.worlds.export_route WORLD FILE`."""

import os
import sys
from pathlib import Path

from paani.errors import UserError
from paani_sim.worlds import World, load_world


def route_toml(world: World) -> str:
    """The route file of the world (format: `paani_services.navigator.route`), in map metres."""
    head = (
        f'name = "{world.name}"\nrepeat = true\n\n[origin]\n'
        f"latitude_deg = {world.origin_lat_deg}\nlongitude_deg = {world.origin_lon_deg}\n"
    )
    points = (f"\n[[waypoints]]\nx_m = {x_m:.4f}\ny_m = {y_m:.4f}\n" for x_m, y_m in world.route_m.tolist())
    return head + "".join(points)


def main(name: str, file: str) -> int:
    """Write the file: beside it first, then renamed. Exit code 2, with one line, for a user's mistake."""
    path = Path(file)
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        beside.write_text(route_toml(load_world(name)), encoding="utf-8")
        beside.replace(path)
    except UserError as error:
        sys.stderr.write(f"{error}\n")
        return 2
    except OSError as error:
        sys.stderr.write(f"{file}: {error.strerror}\n")
        return 2
    return 0


if __name__ == "__main__":
    raise SystemExit(main(*sys.argv[1:3]))
