"""`paani models evaluate`: the exported nets on held-out sequences, as figures, as JSON, or into the manifest."""

from __future__ import annotations

import argparse
import math
import os
import sys
from dataclasses import dataclass
from pathlib import Path

import msgspec

from paani.cluster import Workers, add_cluster_argument, open_workers
from paani.errors import UserError
from paani.idle_options import refuse_options
from paani.option_paths import input_file, input_folder, output_file, output_folder, require_apart
from paani.whole_file import write_json
from paani_models.benchmarks.score_networks import score_lars, score_mods
from paani_models.catalogue import Figure, load_catalogue, save_catalogue, verified_path
from paani_models.commands.compare import compare_detectors, is_detector
from paani_models.datasets.selection import PictureSelection
from paani_models.detector.scores import ScoredBoxes, count_false_alarms, score_boxes
from paani_models.report.estimates import (
    Evaluation,
    MeasuredModel,
    draw_box_curves,
    estimate_boxes,
    estimate_false_alarms,
    estimate_masks,
    tabulate_box_confusion,
    tabulate_mask_confusions,
)
from paani_models.report.manifest_figures import measure_detector, measure_false_alarms, measure_segmenter
from paani_models.report.miss_sheet import refuse_inside_repository
from paani_models.report.records import image_quality_figures, read_faults
from paani_models.segmenter.scores import ScoredMask, score_masks


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Beside --data, --sources, --rendered and --weights."""
    parser.add_argument("nets", nargs="*", default=[], help="names of the manifest; all if not given")
    parser.add_argument("--record", action="store_true", help="write the figures into the manifest")
    parser.add_argument(
        "--faults",
        type=input_file("--faults"),
        metavar="FILE",
        help="image-quality figures, from `paani faults --json`",
    )
    parser.add_argument(
        "--lars", type=input_folder("--lars"), metavar="ROOT", help="score the segmenter by LaRS's protocol instead"
    )
    parser.add_argument(
        "--mods", type=input_folder("--mods"), metavar="ROOT", help="score both nets by MODS's protocol instead"
    )
    parser.add_argument(
        "--predictions",
        type=output_folder("--predictions"),
        help="with --lars or --mods: write masks and boxes in their formats",
    )
    parser.add_argument(
        "--json", type=output_file("--json"), help="write figures with intervals, per source and sequence, to this file"
    )
    parser.add_argument(
        "--html",
        type=output_file("--html"),
        metavar="FILE",
        help="a sheet of the detector's misses and false alarms, outside any repository: it holds pictures",
    )
    add_cluster_argument(parser)


def refuse_idle_options(parser: argparse.ArgumentParser, arguments: argparse.Namespace) -> None:
    """Raises UserError for an option that would be passed over."""
    labelled = ("nets", "--json", "--html", "--cluster")
    if arguments.lars or arguments.mods:
        refuse_options(parser, arguments, (*labelled, "--record", "--faults"), "is not for --lars and --mods")
        return
    refuse_options(parser, arguments, ("--predictions",), "goes with --lars or --mods")
    if arguments.faults:
        refuse_options(parser, arguments, labelled, "is not for --faults")
    require_apart({"--json": arguments.json, "--html": arguments.html})


@dataclass(frozen=True)
class ScoredPair:
    """Everything measured on labelled pictures, picture by picture."""

    evaluation: Evaluation
    masks: list[ScoredMask]
    boxes: list[ScoredBoxes]


def run(arguments: argparse.Namespace, pictures: PictureSelection) -> int:
    """Exit 0, or raise UserError."""
    if arguments.html:
        refuse_inside_repository(arguments.html, "--html")
    if arguments.faults:
        _print_and_record("gate", image_quality_figures(read_faults(arguments.faults)), arguments)
        return 0
    with open_workers(arguments.cluster, os.cpu_count() or 1) as workers:
        _measure(arguments, pictures, workers)
    return 0


def _measure(arguments: argparse.Namespace, pictures: PictureSelection, workers: Workers) -> None:
    catalogue = load_catalogue(arguments.weights)
    nets = arguments.nets or [name for name in catalogue if is_scored(catalogue[name].classes)]
    for net in nets:
        if net not in catalogue or not is_scored(catalogue[net].classes):
            raise UserError(f"{arguments.weights}: no segmenter or detector named {net!r}")
    is_boxed = bool(pictures.boxed_samples(held_out=True))
    compared = {net for net in nets if is_boxed and is_detector(catalogue[net].classes)}
    if arguments.html and not compared:
        raise UserError("--html: shows a detector's boxes, and none is scored on a picture with boxes")
    for net in nets:
        _print_and_record(net, measure_network(net, arguments.weights, pictures, workers), arguments)
        if net in compared:
            compare_detectors(net, arguments.weights, pictures, arguments.html)
    if arguments.json:
        write_evaluation(arguments.json, score_pair(arguments.weights, pictures, workers).evaluation)


def _print_and_record(net: str, figures: list[Figure], arguments: argparse.Namespace) -> None:
    for figure in figures:
        sys.stdout.write(msgspec.json.encode(figure).decode() + "\n")
    if arguments.record:
        catalogue = load_catalogue(arguments.weights)
        if net not in catalogue:
            raise UserError(f"{arguments.weights}: no model named {net!r}")
        if not figures:
            raise UserError(f"--record: nothing was measured of {net}, and its figures stay as they are")
        model = msgspec.structs.replace(catalogue[net], figures=tuple(figures))
        save_catalogue({**catalogue, net: model}, arguments.weights)


def run_benchmark(arguments: argparse.Namespace) -> int:
    """Print one JSON object per benchmark. Exit 0, or raise UserError."""
    segmenter_net = verified_path("segmenter", arguments.weights)
    if arguments.lars:
        _print_rounded(score_lars(segmenter_net, arguments.lars, arguments.predictions))
    if arguments.mods:
        detector_net = verified_path("detector", arguments.weights)
        _print_rounded(score_mods(segmenter_net, detector_net, arguments.mods, arguments.predictions))
    return 0


def _print_rounded(figures: dict[str, float]) -> None:
    rounded = {name: round(value, 3) if math.isfinite(value) else None for name, value in figures.items()}
    sys.stdout.write(msgspec.json.encode(rounded).decode() + "\n")


def is_scored(classes: tuple[str, ...]) -> bool:
    """Whether a model of the manifest is a segmenter or a detector, which labelled pictures can score."""
    return "water" in classes or is_detector(classes)


def measure_network(
    net: str, weights: Path, pictures: PictureSelection, workers: Workers | None = None
) -> list[Figure]:
    """The manifest's figures of one net."""
    path = verified_path(net, weights)
    if "water" in load_catalogue(weights)[net].classes:
        return measure_segmenter(path, pictures.segmented_samples(held_out=True), workers)
    return [
        *measure_detector(path, pictures.boxed_samples(held_out=True), workers),
        *measure_false_alarms(path, pictures.segmented_samples(held_out=True), workers),
    ]


def score_pair(weights: Path, pictures: PictureSelection, workers: Workers | None = None) -> ScoredPair:
    """The shipped pair, picture by picture. Raises UserError where nothing is held out."""
    segmented, boxed = pictures.segmented_samples(held_out=True), pictures.boxed_samples(held_out=True)
    if not segmented and not boxed:
        raise UserError("sources: nothing is held out")
    catalogue = load_catalogue(weights)
    masks = score_masks(verified_path("segmenter", weights), segmented, workers) if segmented else []
    boxes = score_boxes(verified_path("detector", weights), boxed, workers) if boxed else []
    rivers = [sample for sample in segmented if sample.source.empty_of]
    alarms = (
        estimate_false_alarms(rivers, count_false_alarms(verified_path("detector", weights), rivers, workers))
        if rivers
        else ()
    )
    evaluation = Evaluation(
        models=tuple(
            MeasuredModel(name=n, sha256=catalogue[n].sha256) for n in ("segmenter", "detector") if n in catalogue
        ),
        estimates=(*estimate_masks(masks), *estimate_boxes(boxes), *alarms),
        curves=draw_box_curves(boxes),
        confusions=(*tabulate_mask_confusions(masks), *([tabulate_box_confusion(boxes)] if boxes else [])),
    )
    return ScoredPair(evaluation, masks, boxes)


def write_evaluation(path: Path, evaluation: Evaluation) -> None:
    """Written beside, then renamed. Raises UserError naming a file that cannot be written."""
    write_json(path, evaluation)
