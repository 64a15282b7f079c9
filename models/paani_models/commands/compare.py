"""The part of `paani models evaluate` that sets a detector beside two off-the-shelf networks, by source and height."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from paani.arrays import U8
from paani.config import DetectorConfig
from paani.errors import UserError
from paani.whole_file import write_whole
from paani_models.catalogue import load_catalogue, verified_path
from paani_models.datasets.selection import PictureSelection
from paani_models.datasets.sources import DETECTOR_CLASSES
from paani_models.detector.exported import open_detector
from paani_models.detector.metrics import Detections
from paani_models.detector.off_the_shelf import KNOWN, NANODET_FILES, YOLOX_FILE, open_off_the_shelf
from paani_models.engines.ncnn_runner import NOT_INSTALLED, ncnn_version
from paani_models.report.height_scores import (
    DetectorRun,
    FindBoxes,
    HeightRow,
    PictureResult,
    run_detectors,
    score_heights,
)
from paani_models.report.height_table import format_height_table
from paani_models.report.miss_sheet import find_mistakes, refuse_inside_repository, render_sheet
from paani_models.report.reliability import format_reliability, measure_reliability
from paani_models.report.track_recall import format_tracks, measure_tracks


def open_shipped(path: Path) -> FindBoxes:
    """A detector of the shipped contract as a function from a picture to boxes in the picture's pixels."""
    network = open_detector(path)

    def find(picture: U8, confidence: float, limit: int) -> Detections:
        found = network.find(picture, confidence, limit)
        height, width = picture.shape[:2]
        return Detections(found.boxes.clip(0, (width, height, width, height)), found.scores, found.classes)

    return find


def compare_detectors(net: str, weights: Path, pictures: PictureSelection, html: Path | None) -> list[HeightRow]:
    """Run the detector and what is at hand of the two networks, print the table, and write the sheet if wanted.

    Raises UserError where the sheet would lie in a repository or cannot be written.
    """
    if html is not None:
        refuse_inside_repository(html, "--html")
    contract = load_catalogue(weights)[net]
    own = DetectorRun(net, frozenset(contract.classes), open_shipped(verified_path(net, weights)))
    detectors = [own, *_open_yardsticks(pictures.data)]
    results = run_detectors(detectors, pictures.boxed_samples(held_out=True))
    threshold = DetectorConfig().threshold
    rows = score_heights(results, detectors, threshold)
    counted = ", ".join(f"{kind} {threshold(kind):.2f}" for kind in DETECTOR_CLASSES)
    sys.stdout.write(f"Recall and precision of boxes above {counted}.\n{format_height_table(rows)}")
    sys.stdout.write(format_reliability(measure_reliability(results, detectors)))
    sys.stdout.write(format_tracks(measure_tracks(results, detectors, threshold)))
    if html is not None:
        _write_sheet(html, net, results, detectors)
    return rows


def _write_sheet(html: Path, net: str, results: Sequence[PictureResult], detectors: Sequence[DetectorRun]) -> None:
    mistakes = find_mistakes(results, net, detectors, DetectorConfig().threshold)
    write_whole(html, render_sheet(f"Misses and false alarms of {net}", mistakes).encode())
    sys.stdout.write(f"{html}\n")


def _open_yardsticks(data: Path) -> list[DetectorRun]:
    """The off-the-shelf networks; none, saying why, where a file of theirs or ncnn is absent."""
    missing = [name for name in (YOLOX_FILE, *NANODET_FILES) if not (data / name).is_file()]
    reason = f"{data / missing[0]}: missing" if missing else NOT_INSTALLED if ncnn_version() is None else ""
    if reason:
        sys.stderr.write(f"no off-the-shelf networks beside it: {reason}\n")
        return []
    try:
        return [DetectorRun(each.name, KNOWN, each.find) for each in open_off_the_shelf(data, threads=2)]
    except UserError as error:
        sys.stderr.write(f"no off-the-shelf networks beside it: {error}\n")
        return []


def is_detector(classes: tuple[str, ...]) -> bool:
    """Whether a model of the manifest finds boxes of our classes."""
    return classes == DETECTOR_CLASSES
