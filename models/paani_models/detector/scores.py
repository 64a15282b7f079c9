"""Score the exported detector on annotated pictures: its detections beside the boxes that people drew."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from paani.cluster import Workers
from paani_models.datasets.batches import Batch, network_of, score_batches
from paani_models.datasets.sources import DETECTOR_CLASSES, Sample, read_picture
from paani_models.detector.data import letterbox_example, read_boxed
from paani_models.detector.exported import open_detector
from paani_models.detector.metrics import CONFIDENCE, MAX_BOXES, ClassMatches, Detections, iou_matrix, match_class
from paani_models.network_input import SIZE_WH, letterbox_affine

SCORED_CONFIDENCE = 0.01  # lower than the board's threshold, as a precision-recall curve needs
SCORED_BOXES = 100
BACKGROUND = len(DETECTOR_CLASSES)  # last row and column of the confusion matrix


@dataclass(frozen=True)
class ScoredBoxes:
    """One picture, in pixels of 320x256 into which it is letterboxed, whatever size the network takes.

    truth: float32 [n,5], class and corners.
    """

    sample: Sample
    detections: Detections
    truth: NDArray[np.float32]

    def class_matches(self, kind: int) -> ClassMatches:
        """Match the detections of one class."""
        return match_class(self.detections, self.truth, kind)

    @property
    def mistakes(self) -> int:
        """Annotated objects missed and boxes of annotated classes that are none, at CONFIDENCE."""
        table = confusion_counts([self])
        return int(table.sum() - np.trace(table))


def score_boxes(net: Path, samples: Sequence[Sample], workers: Workers | None = None) -> list[ScoredBoxes]:
    """Run the network over samples with boxes. workers: who does; this process if not given.

    Raises UserError naming a file that cannot be read.
    """
    return score_batches(score_box_batch, net, samples, workers, "detector")


def score_box_batch(batch: Batch) -> list[ScoredBoxes]:
    """As `score_boxes`, of one batch."""
    network = open_detector(network_of(batch))
    scored = []
    for sample in batch.samples:
        item = read_boxed(sample)
        found = network.find(item.picture, SCORED_CONFIDENCE, SCORED_BOXES)
        affine = letterbox_affine((item.picture.shape[1], item.picture.shape[0]), SIZE_WH)
        corners = found.boxes.reshape(-1, 2, 2) * affine[0, 0] + affine[:, 2]
        boxes = Detections(corners.reshape(-1, 4).astype(np.float32), found.scores, found.classes)
        scored.append(ScoredBoxes(sample, boxes, letterbox_example(item, SIZE_WH).boxes))
    return scored


def count_false_alarms(net: Path, samples: Sequence[Sample], workers: Workers | None = None) -> list[int]:
    """Count per picture the boxes above CONFIDENCE of classes that its source does not show; as `score_boxes`."""
    return score_batches(count_batch_alarms, net, samples, workers, "false alarms")


def count_batch_alarms(batch: Batch) -> list[int]:
    """As `count_false_alarms`, of one batch."""
    network = open_detector(network_of(batch))
    alarms = []
    for sample in batch.samples:
        found = network.find(read_picture(sample.picture), CONFIDENCE, MAX_BOXES)
        absent = [DETECTOR_CLASSES.index(kind) for kind in sample.source.empty_of]
        alarms.append(int(np.isin(found.classes, absent).sum()))
    return alarms


def select_annotated(scored: Sequence[ScoredBoxes], kind: int) -> list[ScoredBoxes]:
    """Select the pictures whose source boxes every instance of a class."""
    return [item for item in scored if DETECTOR_CLASSES[kind] in item.sample.source.annotated]


def confusion_counts(scored: Sequence[ScoredBoxes]) -> NDArray[np.int64]:
    """Confusion matrix at CONFIDENCE and IoU 0.5, whatever the class: int64 [5,5], rows truth, columns detections, last
    background.

    Best score first, each box takes the free object that it overlaps most. Classes that a source does not annotate
    are left out of its pictures.
    """
    table = np.zeros((BACKGROUND + 1, BACKGROUND + 1), np.int64)
    for item in scored:
        annotated = [DETECTOR_CLASSES.index(kind) for kind in item.sample.source.annotated]
        confident = item.detections.scores > CONFIDENCE
        boxes, kinds = item.detections.boxes[confident], item.detections.classes[confident]
        shared = iou_matrix(boxes, item.truth[:, 1:])
        free = np.ones(len(item.truth), np.bool_)
        for index in np.argsort(-item.detections.scores[confident], kind="stable"):
            row = np.where(free, shared[index], 0.0)
            hit = int(row.argmax()) if len(row) and row.max() >= 0.5 else -1
            if hit >= 0:
                free[hit] = False
            true = int(item.truth[hit, 0]) if hit >= 0 else BACKGROUND
            if true in annotated or (true == BACKGROUND and kinds[index] in annotated):
                table[true, kinds[index]] += 1
        for kind in item.truth[free, 0].astype(int):
            table[kind, BACKGROUND] += int(kind in annotated)
    return table
