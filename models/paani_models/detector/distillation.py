"""Keep what the starting point knew: its answers stand where a source annotates nothing (Li and Hoiem 2017).

The teacher is YOLOX-nano with its COCO weights, of the student's own shape, so that candidate answers candidate on the
same augmented picture. It teaches the classes that it knows; a background candidate of which a source says nothing
learns the teacher's score instead of being left out, and the teacher's box where that score is high.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch
from torch import Tensor
from tqdm import tqdm

from paani.arrays import F32
from paani.errors import UserError
from paani_models.datasets.sources import DETECTOR_CLASSES
from paani_models.detector.data import BoxedPicture
from paani_models.detector.loss import box_corners, exhaustive_candidates, generalised_iou, log_scores
from paani_models.detector.metrics import iou_matrix
from paani_models.detector.off_the_shelf import KNOWN, OffTheShelf
from paani_models.detector.shipped_network import Detector, load_yolox_weights

BOX_MIN_SCORE = 0.3  # of a teacher's candidate whose box is learnt too
LABEL_MIN_SCORE = 0.5  # of a box that a teacher adds to a picture's own
SAME_OBJECT_IOU = 0.5  # of two boxes of which the lower scored one is dropped
BOX_GAIN, SCORE_GAIN = 2.0, 1.0


class Teacher:
    """YOLOX-nano's answers for the classes that it knows; it does not learn."""

    def __init__(self, path: Path) -> None:
        self.net = Detector().eval().requires_grad_(False)
        load_yolox_weights(self.net, path)
        self.known = torch.tensor([kind in KNOWN for kind in DETECTOR_CLASSES])

    @torch.no_grad()
    def answer(self, pictures: Tensor) -> tuple[Tensor, Tensor]:
        """Boxes cx, cy, w, h in input pixels [N,A,4], and joint scores [N,A,4], 0 for classes unknown to it."""
        boxes, logits = self.net.to(pictures.device).raw(pictures)
        return boxes, log_scores(logits)[0].exp() * self.known.to(pictures.device)

    def loss(self, pictures: Tensor, boxes: Tensor, logits: Tensor, exhaustive_mask: Tensor) -> Tensor:
        """How far the student's raw answers lie from the teacher's where nothing is annotated.

        Divided by the sum of the teacher's scores there, as the other losses are by the number of assigned candidates.
        """
        taught, scores = self.answer(pictures)
        silent = ~exhaustive_candidates(exhaustive_mask) & self.known.to(pictures.device)
        log_p, log_not_p = log_scores(logits)
        score_loss = -(silent * (scores * log_p + (1.0 - scores) * log_not_p)).sum()
        sure = (scores * silent).amax(2)
        sure = sure * (sure > BOX_MIN_SCORE)
        box_loss = (sure * (1.0 - generalised_iou(box_corners(boxes), box_corners(taught)))).sum()
        return (BOX_GAIN * box_loss + SCORE_GAIN * score_loss) / (scores * silent).sum().clamp(min=1.0)


def blend_weights(model: Detector, other: Detector, share: float) -> None:
    """Move the model's weights towards another's by `share` (Wortsman et al. 2022); 0 leaves them, 1 takes the other's.

    Raises UserError where the share lies outside 0..1.
    """
    if not 0.0 <= share <= 1.0:
        raise UserError(f"--blend: {share} lies outside 0..1")
    theirs = other.state_dict()
    with torch.no_grad():
        for name, value in model.state_dict().items():
            value.lerp_(theirs[name], share)


def add_teachers_boxes(pictures: list[BoxedPicture], teachers: tuple[OffTheShelf, ...]) -> list[BoxedPicture]:
    """Add the teachers' boxes of classes that a picture's source does not annotate, each object once."""
    return [_add_boxes(item, teachers) for item in tqdm(pictures, "teachers", unit="picture", mininterval=2.0)]


def _add_boxes(item: BoxedPicture, teachers: tuple[OffTheShelf, ...]) -> BoxedPicture:
    full = item.exhaustive_mask.reshape(len(DETECTOR_CLASSES), -1).min(1)
    silent = [kind for kind, name in enumerate(DETECTOR_CLASSES) if name in KNOWN and not full[kind]]
    if not silent:
        return item
    height, width = item.picture.shape[:2]
    size = np.array((width, height, width, height), np.float32)
    found: list[tuple[float, F32]] = []
    for teacher in teachers:
        boxes = teacher.find(item.picture, LABEL_MIN_SCORE, 50)
        for box, score, kind in zip(boxes.boxes, boxes.scores, boxes.classes, strict=True):
            if kind in silent and (box[2:] > box[:2]).all():
                found.append((float(score), np.array((kind, *(box / size)), np.float32)))
    rows = item.boxes
    for _, row in sorted(found, key=lambda pair: -pair[0]):
        if iou_matrix(row[None, 1:], rows[:, 1:]).max(initial=0.0) < SAME_OBJECT_IOU:
            rows = np.vstack([rows, row])
    return BoxedPicture(item.source, item.picture, rows, item.exhaustive_mask)
