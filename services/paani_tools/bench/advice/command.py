"""`paani bench advice`: what is advised on annotated pictures, as shares with intervals, source by source."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path

import msgspec

from paani.cli import add_config_arguments, config_from
from paani.clock import stopwatch_ms
from paani.config import Config
from paani.errors import UserError
from paani.option_numbers import whole_number
from paani.option_paths import input_folder, output_file
from paani.statistics.figure_table import FigureTable, table_text
from paani.whole_file import write_whole
from paani_models.datasets.selection import PictureSelection, source_names
from paani_models.datasets.sources import RENDERED, Sample, read_boxes, read_mask
from paani_services.camera.picture_sources import read_frames
from paani_services.perception.pipeline import Perceiver
from paani_tools.bench.advice.ahead import annotated_ahead, not_water_share
from paani_tools.bench.advice.tally import Judged, advised_lane, count_advice, tabulate
from paani_tools.look.verdict import judge_still
from paani_tools.progress import Progress

OCCUPIED = Path(__file__).with_name("occupied_centres.txt")
MISTAKEN = Path(__file__).with_name("mistaken_masks.txt")


class Report(msgspec.Struct, frozen=True, kw_only=True):
    """What `--json` writes: the table, and every picture with its advice."""

    table: FigureTable
    pictures: tuple[Judged, ...]


def main(argv: list[str]) -> int:
    """Judge every annotated picture of one side of the split and print the shares. Raises UserError."""
    options = _parser().parse_args(argv)
    config = config_from(options)
    selection = PictureSelection(options.data, options.sources, None)
    pictures = by_picture(selection.samples, held_out=options.held_out)
    if not pictures:
        raise UserError(f"{options.data}: no annotated picture of a known source (data folders: `paani models --help`)")
    judged = tuple(judge_pictures(thin_out(pictures, options.most), options.data, config))
    table = tabulate(judged, "held-out" if options.held_out else "development", config)
    sys.stdout.write(table_text(table))
    if options.json:
        write_whole(options.json, msgspec.json.encode(Report(table=table, pictures=judged)) + b"\n", "--json")
    return 0


def by_picture(samples: Sequence[Sample], *, held_out: bool) -> list[list[Sample]]:
    """The samples of each picture of one side; a picture that any source holds out belongs to that side alone."""
    found: dict[Path, list[Sample]] = {}
    for sample in samples:
        if sample.source.name != RENDERED:
            found.setdefault(sample.picture, []).append(sample)
    return [of_one for of_one in found.values() if any(sample.held_out for sample in of_one) == held_out]


def thin_out(pictures: list[list[Sample]], most: int | None) -> list[list[Sample]]:
    """At most so many pictures of each source, at even distances in its order."""
    if most is None:
        return pictures
    by_source: dict[str, list[list[Sample]]] = {}
    for of_one in pictures:
        by_source.setdefault(of_one[0].source.name, []).append(of_one)
    return [
        of_one
        for found in by_source.values()
        for i, of_one in enumerate(found)
        if len(found) <= most or i * most // len(found) != (i - 1) * most // len(found)
    ]


def judge_pictures(pictures: Sequence[Sequence[Sample]], data: Path, config: Config) -> Iterator[Judged]:
    """Judge each picture on its own. Raises UserError naming a file that cannot be read."""
    perceiver = Perceiver(config.perception, stopwatch_ms)
    try:
        with Progress("judging") as progress:
            for number, samples in enumerate(pictures):
                progress.at(number / len(pictures), f"{number} of {len(pictures)}")
                yield _judge(samples, number, perceiver, data, config)
    finally:
        perceiver.close()


@cache
def occupied_centres() -> frozenset[str]:
    """Pictures without boxes in whose centre something floats or stands before the far shore, by eye: a path a line."""
    return frozenset(OCCUPIED.read_text().split())


@cache
def mistaken_masks() -> frozenset[str]:
    """Pictures whose mask says of water that it is none, by eye: a path a line."""
    return frozenset(MISTAKEN.read_text().split())


def _judge(samples: Sequence[Sample], number: int, perceiver: Perceiver, data: Path, config: Config) -> Judged:
    picture, corridors = samples[0].picture, config.perception.corridors
    boxes = next((read_boxes(sample.label) for sample in samples if sample.label), None)
    name = picture.relative_to(data).as_posix()
    masks = () if name in mistaken_masks() else (sample.mask for sample in samples if sample.mask)
    mask = next(map(read_mask, masks), None)
    frame = next(iter(read_frames(picture, config.camera)))
    ahead = annotated_ahead(boxes, mask, corridors)
    if name in occupied_centres():
        ahead = ahead._replace(open_water=False)
    verdict = judge_still(frame, number, perceiver, config)
    lane = advised_lane(verdict.advisory.direction)
    own = human = None
    if lane is not None:
        own = getattr(verdict.evidence, lane).non_water
        human = None if mask is None else not_water_share(mask, getattr(corridors, lane), corridors.top)
    return Judged(
        picture=name,
        source=samples[0].source.name,
        sequence=samples[0].sequence,
        direction=verdict.advisory.direction,
        reason=verdict.advisory.reason,
        explanation=verdict.advisory.explanation,
        counts=count_advice(ahead, verdict.advisory, own, human),
    )


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="paani bench advice",
        description="Judge annotated pictures as the boat would, and count what is advised: straight on with a person "
        "or a vessel ahead, onto what is no water, and over open water. Folders are those of `paani models`.",
    )
    parser.add_argument("data", type=input_folder(), metavar="DATA", help="folder of annotated sources")
    parser.add_argument(
        "--sources", type=source_names, default=[], metavar="NAMES", help="some sources only, separated by commas"
    )
    parser.add_argument("--held-out", action="store_true", help="the held-out sequences, not those to develop on")
    parser.add_argument("--most", type=whole_number(), metavar="N", help="at most so many pictures of each source")
    parser.add_argument("--json", type=output_file("--json"), metavar="FILE", help="write each picture's advice there")
    add_config_arguments(parser)
    return parser
