"""`paani logs`: what is in recordings, mending them, opening them, and handing them to other programs."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from paani.errors import UserError
from paani.extras import require_modules
from paani.logs.folder import recordings
from paani.logs.reader import Log, Record, open_log
from paani.logs.repair import repair
from paani.option_paths import input_folder, input_path, output_file, output_folder, require_apart
from paani.whole_file import json_line
from paani_tools.logs.export import export_csv, export_geojson, export_gpx
from paani_tools.logs.export_ros2 import export_ros2
from paani_tools.logs.info import info_of, info_text, list_text
from paani_tools.progress import Progress


def main(argv: list[str]) -> int:
    """Exit codes: 0 done, 1 `info` of a cut or damaged recording, 2 user's mistake (one line on standard error)."""
    options = _parser().parse_args(argv)
    if options.what == "info":
        return _info(options.path, as_json=options.json)
    if options.what == "repair":
        return _repair(options.path)
    if options.what == "export":
        return _export(options)
    if options.what == "view":
        return _view(options)
    return _list(options.path)


def _info(path: Path, *, as_json: bool) -> int:
    log = open_log(path)
    with Progress("reading") as progress:
        info = info_of(log, ReadProgress(log, progress))
    sys.stdout.write(json_line(info).decode() if as_json else info_text(info))
    for problem in info.problems:
        sys.stderr.write(f"paani: {problem}\n")
    return 1 if info.problems else 0


def _repair(path: Path) -> int:
    repaired = repair(path)
    if not repaired.changed:
        sys.stdout.write(f"{path}: nothing to repair\n")
        return 0
    sys.stdout.write(f"{path}: {repaired.messages} messages kept\n")
    sys.stdout.write("".join(f"lost: {line}\n" for line in repaired.lost))
    if repaired.original is not None:
        sys.stdout.write(f"the file as it was: {repaired.original}\n")
    return 0


def _export(options: argparse.Namespace) -> int:
    exports = {"--csv": export_csv, "--geojson": export_geojson, "--gpx": export_gpx, "--ros2": export_ros2}
    wanted = {option: path for option in exports if (path := getattr(options, option[2:])) is not None}
    if not wanted:
        raise UserError("logs export: say what to write: --csv DIR, --geojson FILE, --gpx FILE or --ros2 FILE")
    require_apart(wanted)
    for option, path in wanted.items():
        if path.exists():
            raise UserError(f"{option} {path}: already exists")
    log = open_log(options.path)
    for option, path in wanted.items():
        with Progress(path.name) as progress:
            summary = exports[option](log, path, ReadProgress(log, progress))
        sys.stdout.write(summary + "\n")
    for problem in log.problems:
        sys.stderr.write(f"{problem}\n")
    return 0


def _view(options: argparse.Namespace) -> int:
    if not options.rerun:
        raise UserError("logs view: say in what: --rerun")
    require_modules("logs view --rerun", "rerun")
    from paani_tools.logs.rerun_view import view_in_rerun  # noqa: PLC0415  # of an extra

    log = open_log(options.path)
    require_apart({"--out": options.out}, log.files)
    with Progress("converting") as progress:
        summary = view_in_rerun(log, options.out, ReadProgress(log, progress))
    sys.stdout.write(summary + "\n")
    for problem in log.problems:
        sys.stderr.write(f"{problem}\n")
    return 0


def _list(folder: Path) -> int:
    if not recordings(folder):
        raise UserError(f"{folder}: no recordings in this folder")
    sys.stdout.write(list_text(folder))
    return 0


class ReadProgress:
    """Shows how far the reading of a log is."""

    def __init__(self, log: Log, progress: Progress) -> None:
        self._start_us, self._span_us = log.start_us, max(log.end_us - log.start_us, 1)
        self._progress = progress
        self._read = 0

    def __call__(self, record: Record) -> None:
        self._read += 1
        if self._read % 500 == 0:
            self._progress.at((record.log_us - self._start_us) / self._span_us)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="paani logs", description="Recordings of `paani up --record DIR`.")
    commands = parser.add_subparsers(dest="what", required=True)
    info = commands.add_parser("info", help="what a recording holds")
    info.add_argument("path", type=input_path(), metavar="FILE|DIR")
    info.add_argument("--json", action="store_true", help="for programs")
    mend = commands.add_parser("repair", help="mend a recording that was cut short or damaged")
    mend.add_argument("path", type=input_path(), metavar="FILE")
    export = commands.add_parser("export", help="write tables or tracks")
    export.add_argument("path", type=input_path(), metavar="FILE|DIR")
    export.add_argument(
        "--csv", type=output_folder("--csv"), metavar="DIR", help="a table for each topic, into a new folder"
    )
    export.add_argument("--geojson", type=output_file("--geojson"), metavar="FILE", help="the track, for maps")
    export.add_argument("--gpx", type=output_file("--gpx"), metavar="FILE", help="the track, for chart plotters")
    export.add_argument("--ros2", type=output_file("--ros2"), metavar="FILE", help="a bag of ROS 2 (MCAP)")
    view = commands.add_parser("view", help="open a recording in a viewer")
    view.add_argument("path", type=input_path(), metavar="FILE|DIR")
    view.add_argument("--rerun", action="store_true", help="in Rerun: pictures, boxes, tracks, map and plots")
    view.add_argument(
        "--out", type=output_file("--out"), metavar="FILE", help="write a file for it (.rrd) instead of opening it"
    )
    listing = commands.add_parser("list", help="the recordings of a folder")
    listing.add_argument("path", type=input_folder(), metavar="DIR")
    return parser
