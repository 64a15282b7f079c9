"""`paani models report --out DIR`: measure, draw, and write one page. Pictures go into DIR and nowhere else."""

from __future__ import annotations

import argparse
import shutil
import sys
from pathlib import Path

from paani.errors import UserError
from paani.option_paths import input_file, input_folder, output_folder
from paani.whole_file import write_whole
from paani_models.catalogue import load_catalogue, verified_path
from paani_models.commands.evaluate import score_pair, write_evaluation
from paani_models.datasets.selection import PictureSelection
from paani_models.datasets.sources import RENDERED
from paani_models.report.box_errors import analyse_box_errors
from paani_models.report.evidence import Evidence, Finding, read_findings
from paani_models.report.experiments import EXPERIMENTS, encode_experiments, read_experiments, with_present_weights
from paani_models.report.mask_errors import analyse_mask_errors
from paani_models.report.overlays import PICTURES, choose_extreme_boxes, choose_extreme_masks, draw_boxes, draw_masks
from paani_models.report.page import PageContent, page
from paani_models.report.records import read_faults, read_training_record
from paani_models.report.requirements import compare_with_requirements
from paani_models.segmenter.scores import open_segmenter

PAGE = "index.html"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Beside --data, --sources, --rendered and --weights."""
    parser.add_argument(
        "--out", type=output_folder("--out"), required=True, help="folder outside any repository; made if missing"
    )
    parser.add_argument(
        "--runs", type=input_folder("--runs"), action="append", default=[], help="folder of a training, repeatable"
    )
    parser.add_argument("--faults", type=input_file("--faults"), help="file written by `paani faults --json`")
    parser.add_argument(
        "--evidence",
        type=input_file("--evidence"),
        action="append",
        default=[],
        help="findings of another class, repeatable",
    )


def run(arguments: argparse.Namespace, pictures: PictureSelection) -> int:
    """Write page, evaluation.json, experiments.json and pictures/. Returns 0; raises UserError before it measures."""
    out: Path = arguments.out.resolve()
    repository = next((folder for folder in (out, *out.parents) if (folder / ".git").exists()), None)
    if repository is not None:
        raise UserError(f"--out: {arguments.out} is inside the repository {repository}; the report holds pictures")
    runs = {folder.name: read_training_record(folder) for folder in arguments.runs}
    faults = read_faults(arguments.faults) if arguments.faults else None
    experiments = read_experiments(arguments.weights)
    findings = [finding for path in arguments.evidence for finding in _other_findings(path)]
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"{out}: {error.strerror}") from error
    scored = score_pair(arguments.weights, pictures)
    if (out / PAGE).is_file():
        shutil.rmtree(out / PICTURES, ignore_errors=True)
    worst_masks, best_masks = choose_extreme_masks(scored.masks)
    worst_boxes, best_boxes = choose_extreme_boxes(scored.boxes)
    segment = open_segmenter(verified_path("segmenter", arguments.weights))
    limits = analyse_mask_errors(
        [s for s in pictures.segmented_samples(held_out=True) if s.source.name != RENDERED], segment
    )
    box_limited = analyse_box_errors(scored.boxes)
    bars = compare_with_requirements(limits, box_limited, faults)
    experiments = with_present_weights(experiments, load_catalogue(arguments.weights), bars)
    masks, boxes = draw_masks(out, [*worst_masks, *best_masks], segment), draw_boxes(out, [*worst_boxes, *best_boxes])
    content = PageContent(
        evaluation=scored.evaluation,
        findings=findings,
        runs=runs,
        faults=faults,
        requirements=bars,
        experiments=experiments,
        mask_errors=limits,
        box_errors=box_limited,
        worst_masks=masks[: len(worst_masks)],
        best_masks=masks[len(worst_masks) :],
        worst_boxes=boxes[: len(worst_boxes)],
        best_boxes=boxes[len(worst_boxes) :],
    )
    write_evaluation(out / "evaluation.json", scored.evaluation)
    write_whole(out / EXPERIMENTS, encode_experiments(experiments))
    write_whole(out / PAGE, page(content).encode())
    sys.stdout.write(f"{out / PAGE}\n")
    return 0


def _other_findings(path: Path) -> tuple[Finding, ...]:
    findings = read_findings(path)
    if findings.evidence is Evidence.LABELLED:
        raise UserError(f"{path}: figures on labelled pictures are measured here, not taken from a file")
    return findings.findings
