"""`paani world`: list scenarios, draw one, write its MuJoCo model, or check scenario files."""

import argparse
import os
import re
import sys
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
from tqdm import tqdm

from paani.arrays import U8
from paani.cluster import add_cluster_argument, open_workers
from paani.errors import UserError
from paani.option_numbers import whole_number
from paani.option_paths import output_file, output_folder
from paani.whole_file import write_whole
from paani_sim.worlds import FIXED_WORLDS, WORLDS
from paani_sim.worlds.load import SCENARIOS, load_scenario
from paani_sim.worlds.scenario import Scenario
from paani_sim.worlds.waterway import SHOWN_SEED

VIEW_PX = (480, 360)
MIN_VIEW_PX, MAX_VIEW_PX = 16, 2048


def main(argv: list[str]) -> int:
    """Exit codes: 0 done, 2 user's mistake."""
    options = _parser().parse_args(argv)
    return int(options.run(options))


def _list(_: argparse.Namespace) -> int:
    rows: list[tuple[str, ...]] = [("scenario", "world", "route", "fixed", "moving", "faults")]
    rows += [_row(load_scenario(name)) for name in (*WORLDS, *SCENARIOS)]
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    for row in rows:
        sys.stdout.write("  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)).rstrip() + "\n")
    sys.stdout.write("random:WORLD:SEED  drawn at random\n")
    return 0


def _row(scenario: Scenario) -> tuple[str, ...]:
    world = scenario.world
    lap = " lap" if world.route_closed else ""
    faults = ", ".join(dict.fromkeys(str(fault.kind) for fault in scenario.faults))
    counts = (str(len(world.obstacles)), str(len(world.actors)))
    return (scenario.name, world.name, f"{world.route_length_m:.0f} m{lap}", *counts, faults)


def _check(options: argparse.Namespace) -> int:
    wrong = 0
    for file in options.files:
        try:
            scenario = load_scenario(file)
        except UserError as error:
            wrong += 1
            sys.stderr.write(f"paani: {error}\n")
        else:
            sys.stdout.write(f"{file}: sound ({', '.join(text for text in _row(scenario)[1:3])})\n")
    return 2 if wrong else 0


def _render(options: argparse.Namespace) -> int:
    from paani_sim.worlds.scenario_sheet import VIEWS, render_sheet  # noqa: PLC0415  the rest needs no OpenGL

    _check_is_png(options.out)
    return _write_sheet(options, render_sheet(load_scenario(options.scenario), *options.size), VIEWS, options.scenario)


def _catalogue(options: argparse.Namespace) -> int:
    from paani_sim.worlds.catalogue_sheet import count_views, render_catalogue  # noqa: PLC0415

    _check_is_png(options.out)
    width_px, height_px = options.size
    pictures = render_catalogue(width_px, height_px, options.seed)
    return _write_sheet(options, pictures, count_views(), "catalogue")


def _check_is_png(out: Path) -> None:
    if out.suffix.lower() != ".png":
        raise UserError(f"--out {out}: must end in .png")


def _write_sheet(options: argparse.Namespace, pictures: Iterator[U8 | None], views: int, name: str) -> int:
    """The last of the pictures, after a None for each view."""
    picture = None
    with tqdm(total=views, unit="view", desc=name, disable=None) as progress:
        for picture in pictures:
            progress.update(picture is None)
    _, data = cv2.imencode(".png", np.asarray(picture))
    write_whole(options.out, data.tobytes(), "--out")
    return 0


def _mjcf(options: argparse.Namespace) -> int:
    from paani_sim.vessels import load_vessel  # noqa: PLC0415
    from paani_sim.worlds.spec import build_spec  # noqa: PLC0415  the rest needs no MuJoCo

    scenario = load_scenario(options.scenario)
    spec = build_spec(scenario.world, load_vessel(scenario.vessel), visual=True)
    spec.compile()
    write_whole(options.out, spec.to_xml().encode(), "--out")
    return 0


def _dataset(options: argparse.Namespace) -> int:
    from paani_sim.worlds.dataset import write_dataset  # noqa: PLC0415  the rest needs no OpenGL

    with open_workers(options.cluster, os.cpu_count() or 1) as workers:
        manifest = write_dataset(options.out, options.n, options.seed, options.worlds, workers=workers)
    boxes = ", ".join(f"{number} {name}" for name, number in manifest.boxes.items())
    sys.stdout.write(f"{options.out}: {manifest.images} pictures, boxes: {boxes}\n")
    return 0


def size(text: str) -> tuple[int, int]:
    """Width and height [px]."""
    if not re.fullmatch("[0-9]{1,5}x[0-9]{1,5}", text):
        raise argparse.ArgumentTypeError(f"'{text}' is not WIDTHxHEIGHT")
    width, height = map(whole_number(MIN_VIEW_PX, MAX_VIEW_PX), text.split("x"))
    return width, height


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="paani world", description=__doc__)
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    listed = commands.add_parser("list", help="the worlds and scenarios that can be named")
    listed.set_defaults(run=_list)
    render = commands.add_parser("render", help="a sheet: the plan, and what the camera sees along the route")
    render.add_argument("--size", type=size, default=VIEW_PX, metavar="WIDTHxHEIGHT", help="of a view (480x360)")
    catalogue = commands.add_parser("catalogue", help="a sheet: who moves on a waterway, what it is made of, its light")
    catalogue.add_argument("--size", type=size, default=VIEW_PX, metavar="WIDTHxHEIGHT", help="of a view (480x360)")
    catalogue.add_argument("--seed", type=whole_number(0), default=SHOWN_SEED, help="of the waterway that is shown")
    catalogue.add_argument("--out", type=output_file("--out"), required=True, metavar="FILE")
    catalogue.set_defaults(run=_catalogue)
    check = commands.add_parser("check", help="whether scenario files are sound")
    check.add_argument("files", nargs="+", metavar="FILE")
    check.set_defaults(run=_check)
    mjcf = commands.add_parser("mjcf", help="the MuJoCo model of boat and solids, as XML")
    for command, run in ((render, _render), (mjcf, _mjcf)):
        command.add_argument("scenario", help="name or TOML file")
        command.add_argument("--out", type=output_file("--out"), required=True, metavar="FILE")
        command.set_defaults(run=run)
    dataset = commands.add_parser("dataset", help="labelled pictures for training")
    dataset.add_argument("--n", type=whole_number(1, 1_000_000), required=True, help="how many pictures")
    dataset.add_argument("--seed", type=whole_number(0), default=0)
    dataset.add_argument("--out", type=output_folder("--out"), required=True, metavar="DIR")
    dataset.add_argument("--worlds", nargs="+", default=list(FIXED_WORLDS), metavar="WORLD")
    add_cluster_argument(dataset)
    dataset.set_defaults(run=_dataset)
    return parser
