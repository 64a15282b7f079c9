"""`paani bench eyes`: where a picture's time goes, side by side in one run."""

import argparse
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import cv2
import msgspec
import numpy as np

from paani.arrays import U8
from paani.cli import add_config_arguments, config_from
from paani.clock import stopwatch_ms
from paani.config import Config, PerceptionConfig
from paani.errors import UserError
from paani.option_numbers import whole_number
from paani.option_paths import input_folder, output_file
from paani.whole_file import write_json
from paani_models.catalogue import PAPER_WEIGHTS, verified_path
from paani_services.perception.engine import network_path
from paani_services.perception.picture_decoding import decode_picture
from paani_tools.bench.eyes.drawn_scene import SIZE_WH, draw_scene
from paani_tools.bench.eyes.memory import Footprint
from paani_tools.bench.eyes.stages import Candidate, Ratio, Row, measure_steps, ratios, rows, steps, usable_pictures
from paani_tools.bench.eyes.work import Work, count_work

SUFFIXES = {".jpg", ".jpeg", ".png"}
MAX_PICTURES = 64
RSS_BAR_MIB = 200.0


class Eyes(msgspec.Struct, frozen=True):
    """What `--json` writes. `footprint` is of a process of its own; `count_work` is of pairs of nets, the first in use.

    `refused`: pictures that the image-quality check did not let through, and that were left out.
    """

    cores: int
    load_before: float
    load_after: float
    pictures: int
    refused: int
    rows: tuple[Row, ...]
    ratios: tuple[Ratio, ...]
    footprint: Footprint
    work: tuple[Work, ...]


def main(argv: list[str]) -> int:
    """Measure, print, write. Raises UserError naming the folder or model that cannot be used."""
    parser = argparse.ArgumentParser(prog="paani bench eyes", description="Time every step of perception.")
    parser.add_argument(
        "--rounds", type=whole_number(), default=100, metavar="N", help="runs of each step (default: 100)"
    )
    parser.add_argument("--folder", type=input_folder("--folder"), help="pictures to perceive; drawn ones if not given")
    parser.add_argument("--json", type=output_file("--json"), metavar="FILE", help="write the figures there too")
    parser.add_argument(
        "--with",
        dest="others",
        type=input_folder("--with"),
        action="append",
        default=[],
        metavar="FOLDER",
        help="also a pipeline with the detector*.onnx and segmenter*.onnx of a folder; may be repeated",
    )
    add_config_arguments(parser)
    options = parser.parse_args(argv)
    config = config_from(options)
    pictures = _read(options.folder) if options.folder else [draw_scene(seed) for seed in range(8)]
    given = len(pictures)
    pictures = usable_pictures(pictures, config.perception)
    if not pictures:
        raise UserError("the image-quality check refuses every picture, so there is nothing to time")
    candidates = [_candidate(folder) for folder in options.others]
    held = _footprint(config)
    cores, load_before = os.cpu_count() or 1, os.getloadavg()[0]
    timed = steps(config.perception, candidates, stopwatch_ms)
    taken: dict[str, list[float]] = {}
    for turn, taken in measure_steps(  # noqa: B007 - the last one is the result
        timed, pictures, options.rounds, stopwatch_ms
    ):
        if sys.stderr.isatty():
            sys.stderr.write(f"\r{max(0, turn):4} of {options.rounds} rounds")
    if sys.stderr.isatty():
        sys.stderr.write("\r" + " " * 30 + "\r")
    found = rows(taken)
    report = Eyes(
        cores=cores,
        load_before=round(load_before, 2),
        load_after=round(os.getloadavg()[0], 2),
        pictures=len(pictures),
        refused=given - len(pictures),
        rows=found,
        ratios=ratios(found, candidates),
        footprint=held,
        work=_work(config.perception, candidates),
    )
    sys.stdout.write(text(report))
    if options.json:
        write_json(options.json, report, "--json")
    return 0


def text(report: Eyes) -> str:
    """Two tables and three lines."""
    lines = [f"{'step':44} {'least [ms]':>11} {'median [ms]':>12} {'p95 [ms]':>10} {'n':>5}"]
    lines += [
        f"{row.name:44} {row.least_ms:11.3f} {row.median_ms:12.3f} {row.p95_ms:10.3f} {row.n:5}" for row in report.rows
    ]
    lines += ["", f"{'ratio':56} {'of medians':>11} {'of least':>9} {'bar':>6}"]
    lines += [
        f"{r.name:56} {r.medians:11.3f} {r.least:9.3f} {'-' if r.bar is None else format(r.bar, '.2f'):>6}"
        for r in report.ratios
    ]
    held = report.footprint
    lines += [
        "",
        f"perceiving alone holds {held.rss_mib:.1f} MiB (bar {RSS_BAR_MIB:.0f}); "
        f"{held.growth_mib:+.2f} MiB over the last of {held.frames} frames",
        *(
            f"{work.name}: {work.bytes} bytes"
            + (
                ""
                if work.multiply_adds is None
                else f", {work.multiply_adds / 1e6:.0f} million multiply-adds a picture"
            )
            for work in report.work
        ),
        f"{report.pictures} pictures, {report.refused} left out; {report.cores} cores, "
        f"load {report.load_before:.2f} before and {report.load_after:.2f} after",
    ]
    return "\n".join(lines) + "\n"


def _candidate(folder: Path) -> Candidate:
    """Raises UserError where the folder holds neither net, or several of one."""
    files = {}
    for role in ("detector", "segmenter"):
        matches = sorted(folder.glob(f"{role}*.onnx"))
        if len(matches) > 1:
            raise UserError(f"--with {folder}: several {role}s: {', '.join(path.name for path in matches)}")
        files[role] = str(matches[0]) if matches else ""
    if not any(files.values()):
        raise UserError(f"--with {folder}: no detector*.onnx or segmenter*.onnx")
    return Candidate(folder.name, files["detector"], files["segmenter"])


def _read(folder: Path) -> list[U8]:
    """At most MAX_PICTURES pictures, evenly from the sorted ones. Raises UserError naming what cannot be read."""
    if not folder.is_dir():
        raise UserError(f"--folder {folder}: no such folder")
    files = sorted(path for path in folder.iterdir() if path.suffix.lower() in SUFFIXES and path.is_file())
    if not files:
        raise UserError(f"--folder {folder}: no pictures ({', '.join(sorted(SUFFIXES))})")
    found = []
    for path in files[:: max(1, len(files) // MAX_PICTURES)][:MAX_PICTURES]:
        picture = decode_picture(path.read_bytes())
        if picture is None:
            raise UserError(f"{path}: not a readable picture")
        found.append(np.asarray(cv2.resize(picture, SIZE_WH), np.uint8))
    return found


def _footprint(config: Config) -> Footprint:
    """Of a child, so that what the measurement itself holds does not count."""
    child = subprocess.run(
        [sys.executable, "-m", "paani_tools.bench.eyes.memory"],
        input=msgspec.json.encode(config),
        capture_output=True,
        check=True,
    )
    return msgspec.json.decode(child.stdout, type=Footprint)


def _work(config: PerceptionConfig, candidates: Sequence[Candidate]) -> tuple[Work, ...]:
    given = {role: network_path(role, config) for role in ("detector", "segmenter")}
    used = {role: Path(path) if path else verified_path(role) for role, path in given.items()}
    found = [count_work("nets in use", used.values())]
    for candidate in candidates:
        other = {"detector": candidate.detector, "segmenter": candidate.segmenter}
        found.append(
            count_work(candidate.name, (Path(path) if path else verified_path(role) for role, path in other.items()))
        )
    found.append(count_work("paper's pair", (verified_path(role, PAPER_WEIGHTS) for role in used)))
    return tuple(found)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
