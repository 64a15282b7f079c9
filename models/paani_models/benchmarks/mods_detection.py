"""Detection protocol of MODS (Bovcon et al. 2021): the results file and the F-scores of its three set-ups."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from paani.whole_file import write_whole
from paani_models.benchmarks.mods import Dataset
from paani_models.detector.metrics import match_boxes

MIN_IOU = 0.3
TYPE_OF = {"vessel": 0, "person": 1, "pier": 2, "buoy": 2}  # ship, person, other


class Detection(msgspec.Struct, frozen=True):
    """bbox: x, y, width, height [px]; id is unique in its frame."""

    id: int
    type: int
    bbox: tuple[int, int, int, int]


class FrameResult(msgspec.Struct, frozen=True):
    """What was found in one picture."""

    id: int
    image_file_name: str
    detections: tuple[Detection, ...]


class SequenceResult(msgspec.Struct, frozen=True):
    """All frames of a sequence, in the annotation's order."""

    id: int
    path: str
    num_frames: int
    frames: tuple[FrameResult, ...]


class DatasetResult(msgspec.Struct, frozen=True):
    """The root of the file."""

    name: str
    num_seq: int
    sequences: tuple[SequenceResult, ...]


class Results(msgspec.Struct, frozen=True):
    """The file."""

    dataset: DatasetResult


def as_detections(classes: list[str], corners: NDArray[np.float32]) -> tuple[Detection, ...]:
    """Our classes and corner boxes [n,4] in picture pixels -> the file's types and whole-pixel x, y, width, height."""
    found = []
    for index, (kind, row) in enumerate(zip(classes, np.round(corners).astype(int).tolist(), strict=True)):
        left, top, right, bottom = row
        found.append(Detection(index, TYPE_OF[kind], (left, top, right - left, bottom - top)))
    return tuple(found)


def build_results(name: str, dataset: Dataset, found: Mapping[tuple[int, int], tuple[Detection, ...]]) -> Results:
    """The file's content for every annotated frame. found: by sequence id and frame id; absent means none."""
    sequences = tuple(
        SequenceResult(
            each.id,
            each.path,
            len(each.frames),
            tuple(FrameResult(f.id, f.image_file_name, found.get((each.id, f.id), ())) for f in each.frames),
        )
        for each in dataset.sequences
    )
    return Results(DatasetResult(name, len(sequences), sequences))


def write_results(path: Path, content: Results) -> None:
    """In the benchmark's form. Raises UserError naming the file."""
    write_whole(path, msgspec.json.encode(content))


def f_score(pairs: list[tuple[NDArray[np.float32], NDArray[np.float32]]], *, by_class: bool) -> float:
    """F of (found, true) per picture, rows [class, x1, y1, x2, y2]; each true box is found once, at IoU 0.3.

    by_class: a box of another class finds nothing. 1 where there is nothing to find and nothing found.
    """
    found_right, found, true = 0, 0, 0
    for ours, theirs in pairs:
        kinds = np.unique(np.append(ours[:, 0], theirs[:, 0])) if by_class else [None]
        for kind in kinds:
            mine, real = (rows if kind is None else rows[rows[:, 0] == kind] for rows in (ours, theirs))
            scores = np.ones(len(mine), np.float32)
            found_right += int(match_boxes(mine[:, 1:], scores, real[:, 1:], MIN_IOU).sum())
        found += len(ours)
        true += len(theirs)
    return 2 * found_right / (found + true) if found + true else 1.0


def challenge_score(by_class: float, agnostic: float, in_zone: float) -> float:
    """Mean F of the three set-ups: with classes, without, and in the danger zone without."""
    return (by_class + agnostic + in_zone) / 3
