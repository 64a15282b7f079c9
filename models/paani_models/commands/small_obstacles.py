"""`paani models small-obstacles`: how many of the small obstacles near the boat both nets see."""

from __future__ import annotations

import argparse
import sys

from paani.option_paths import output_file
from paani.whole_file import write_json
from paani_models.catalogue import verified_path
from paani_models.commands.compare import open_shipped
from paani_models.datasets.selection import PictureSelection
from paani_models.report.small_obstacles import format_small_obstacles, measure_small_obstacles
from paani_models.segmenter.scores import open_segmenter


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Beside --data, --sources, --rendered and --weights."""
    parser.add_argument("--json", type=output_file("--json"), help="write the figures to this file too")


def run(arguments: argparse.Namespace, pictures: PictureSelection) -> int:
    """Exit 0, or raise UserError."""
    found = measure_small_obstacles(
        pictures.boxed_samples(held_out=True),
        open_segmenter(verified_path("segmenter", arguments.weights)),
        open_shipped(verified_path("detector", arguments.weights)),
    )
    sys.stdout.write(format_small_obstacles(found))
    if arguments.json:
        write_json(arguments.json, found)
    return 0
