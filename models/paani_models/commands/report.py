"""`paani models report --out DIR`: measure, draw, and write one page. Pictures go into DIR and nowhere else."""

from __future__ import annotations

import argparse
import shutil
import sys
from pathlib import Path

from paani.errors import UserError
from paani.option_paths import input_file, output_folder
from paani.whole_file import write_whole
from paani_models.catalogue import load_catalogue, verified_path
from paani_models.commands.evaluate import score, write
from paani_models.datasets.selection import Pictures
from paani_models.datasets.sources import RENDERED
from paani_models.report.bars import reached
from paani_models.report.box_limits import box_limits
from paani_models.report.evidence import Evidence, Finding, read_findings
from paani_models.report.mask_limits import mask_limits
from paani_models.report.overlays import PICTURES, draw_boxes, draw_masks, ends_of_boxes, ends_of_masks
from paani_models.report.page import Content, page
from paani_models.report.records import read_faults, read_record
from paani_models.report.tried import TRIED, encoded, read_tried, with_present
from paani_models.segmenter.scores import segmenter

PAGE = "index.html"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Beside --data, --sources, --rendered and --weights."""
    parser.add_argument(
        "--out", type=output_folder("--out"), required=True, help="folder outside any repository; made if missing"
    )
    parser.add_argument("--runs", type=Path, action="append", default=[], help="folder of a training, repeatable")
    parser.add_argument("--faults", type=input_file("--faults"), help="file written by `paani faults --json`")
    parser.add_argument(
        "--evidence", type=Path, action="append", default=[], help="findings of another class, repeatable"
    )


def run(arguments: argparse.Namespace, pictures: Pictures) -> int:
    """Write the page, evaluation.json, tried.json and pictures/. Exit 0, or raise UserError before it measures."""
    out: Path = arguments.out.resolve()
    repository = next((folder for folder in (out, *out.parents) if (folder / ".git").exists()), None)
    if repository is not None:
        raise UserError(f"--out: {arguments.out} is inside the repository {repository}; the report holds pictures")
    runs = {folder.name: read_record(folder) for folder in arguments.runs}
    faults = read_faults(arguments.faults) if arguments.faults else None
    tried = read_tried(arguments.weights)
    findings = [finding for path in arguments.evidence for finding in _other_findings(path)]
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"{out}: {error.strerror}") from error
    scored = score(arguments.weights, pictures)
    if (out / PAGE).is_file():
        shutil.rmtree(out / PICTURES, ignore_errors=True)
    worst_masks, best_masks = ends_of_masks(scored.masks)
    worst_boxes, best_boxes = ends_of_boxes(scored.boxes)
    segment = segmenter(verified_path("segmenter", arguments.weights))
    limits = mask_limits([s for s in pictures.segmented(held_out=True) if s.source.name != RENDERED], segment)
    box_limited = box_limits(scored.boxes)
    bars = reached(limits, box_limited, faults)
    tried = with_present(tried, load_catalogue(arguments.weights), bars)
    masks, boxes = draw_masks(out, [*worst_masks, *best_masks], segment), draw_boxes(out, [*worst_boxes, *best_boxes])
    content = Content(
        evaluation=scored.evaluation,
        findings=findings,
        runs=runs,
        faults=faults,
        reached=bars,
        tried=tried,
        mask_limits=limits,
        box_limits=box_limited,
        worst_masks=masks[: len(worst_masks)],
        best_masks=masks[len(worst_masks) :],
        worst_boxes=boxes[: len(worst_boxes)],
        best_boxes=boxes[len(worst_boxes) :],
    )
    write(out / "evaluation.json", scored.evaluation)
    write_whole(out / TRIED, encoded(tried))
    beside = out / f"{PAGE}.partial"
    beside.write_text(page(content), encoding="utf-8")
    beside.replace(out / PAGE)
    sys.stdout.write(f"{out / PAGE}\n")
    return 0


def _other_findings(path: Path) -> tuple[Finding, ...]:
    findings = read_findings(path)
    if findings.evidence is Evidence.LABELLED:
        raise UserError(f"{path}: figures on labelled pictures are measured here, not taken from a file")
    return findings.findings
