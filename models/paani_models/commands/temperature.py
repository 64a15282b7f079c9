"""`paani models temperature`: the calibration of a segmenter's confidence, and the setting that improves it."""

from __future__ import annotations

import argparse
import os
import sys

from paani.cluster import add_cluster_argument, open_workers
from paani.option_paths import output_file
from paani.whole_file import write_json
from paani_models.catalogue import verified_path
from paani_models.datasets.selection import PictureSelection
from paani_models.report.mask_calibration import format_mask_calibration, measure_mask_calibration


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Beside --data, --sources, --rendered and --weights."""
    parser.add_argument("--json", type=output_file("--json"), help="write the figures to this file too")
    add_cluster_argument(parser)


def run(arguments: argparse.Namespace, pictures: PictureSelection) -> int:
    """Exit 0, or raise UserError."""
    with open_workers(arguments.cluster, os.cpu_count() or 1) as workers:
        found = measure_mask_calibration(
            verified_path("segmenter", arguments.weights), pictures.segmented_samples(held_out=True), workers
        )
    sys.stdout.write(format_mask_calibration(found))
    if arguments.json:
        write_json(arguments.json, found)
    return 0
