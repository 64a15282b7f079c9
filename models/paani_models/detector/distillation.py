"""Keep what the starting point knew: its answers stand where a source annotates nothing (Li and Hoiem 2017).

The teacher is YOLOX-nano with its COCO weights, of the student's own shape, so that candidate answers candidate on the
same augmented picture. It teaches the classes that it knows; a background candidate of which a source says nothing
learns the teacher's score instead of being left out, and the teacher's box where that score is high.
"""

from __future__ import annotations

import hashlib
from pathlib import Path

import msgspec
import numpy as np
import torch
from torch import Tensor, nn
from tqdm import tqdm

from paani.arrays import F32
from paani.errors import UserError
from paani.undecodable import UNREADABLE
from paani.whole_file import write_json
from paani_models.datasets.sources import DETECTOR_CLASSES, LOOSE_SOURCES
from paani_models.detector.data import BoxedPicture
from paani_models.detector.loss import Taught, log_scores
from paani_models.detector.metrics import iou_matrix
from paani_models.detector.off_the_shelf import KNOWN, OffTheShelf
from paani_models.detector.shipped_network import FIRST_STAGES, Detector, load_yolox_weights

LABEL_MIN_SCORE = 0.5  # of a box that a teacher adds to a picture's own
HINTED_MIN_SCORE, INSIDE_FRAC = 0.15, 0.7  # of one that lies to that share inside a loose box of its class
SAME_OBJECT_IOU = 0.5  # of two boxes of which the lower scored one is dropped


class Teacher:
    """YOLOX-nano's answers for the classes that it knows; it does not learn."""

    def __init__(self, path: Path) -> None:
        self.net = Detector().eval().requires_grad_(False)
        load_yolox_weights(self.net, path)
        self.known = torch.tensor([kind in KNOWN for kind in DETECTOR_CLASSES])

    def has_first_stages_of(self, model: Detector) -> bool:
        """Whether the model's first stages are the teacher's to the bit, so that frozen ones need one pass for both."""
        ours = dict(self.net.named_parameters())
        return all(
            torch.equal(value.cpu(), ours[name].cpu())
            for name, value in model.named_parameters()
            if name.split(".")[0] in FIRST_STAGES
        )

    @torch.no_grad()
    def first_stages(self, pictures: Tensor) -> Tensor:
        """What its first stages make of pictures [N,3,H,W]."""
        return self.net.to(pictures.device).first_stages(pictures)

    @torch.no_grad()
    def answer(self, c3: Tensor) -> Taught:
        """Its candidates; scores are 0 for classes unknown to it. c3: what its first stages made of the pictures."""
        boxes, logits = self.net.to(c3.device).raw_after(c3)
        known = self.known.to(c3.device)
        return Taught(boxes, log_scores(logits)[0].exp() * known, known)


def blend_weights(model: nn.Module, other: nn.Module, share: float, option: str = "--blend") -> None:
    """Move the model's weights towards another's by `share` (Wortsman et al. 2022); 0 leaves them, 1 takes the other's.

    Raises UserError naming the option whose share lies outside 0..1.
    """
    if not 0.0 <= share <= 1.0:
        raise UserError(f"{option}: {share} lies outside 0..1")
    theirs = other.state_dict()
    with torch.no_grad():
        for name, value in model.state_dict().items():
            value.lerp_(theirs[name], share)


def add_teachers_boxes(
    pictures: list[BoxedPicture], teachers: tuple[OffTheShelf, ...], cache: Path
) -> list[BoxedPicture]:
    """Add the teachers' boxes of classes that a picture's source does not annotate, each object once.

    Of a source with loose boxes theirs take the place of its own: those well inside one of them, and of what it leaves
    out; its pictures then say of nothing that it is absent. What was found for the same pictures is read from `cache`,
    else written there.
    """
    try:
        stored = msgspec.json.decode(cache.read_bytes(), type=dict[str, _Rows]) if cache.is_file() else {}
    except UNREADABLE as error:
        raise UserError(f"{cache}: {error}") from error
    keys = [_checksum(item) for item in pictures]
    missing = [i for i, key in enumerate(keys) if key not in stored and _asked(pictures[i])]
    for i in tqdm(missing, "teachers", unit="picture", mininterval=2.0):
        stored[keys[i]] = _find_boxes(pictures[i], teachers)
    if missing:
        cache.parent.mkdir(parents=True, exist_ok=True)
        write_json(cache, stored)
    return [_with_boxes(item, stored[key]) if _asked(item) else item for item, key in zip(pictures, keys, strict=True)]


_Rows = list[tuple[float, float, float, float, float]]  # class and corners, normalised


def _checksum(item: BoxedPicture) -> str:
    digest = hashlib.sha256(item.source.encode())
    for part in (item.boxes, item.exhaustive_mask, item.picture):
        digest.update(np.ascontiguousarray(part).tobytes())
    return digest.hexdigest()


def _asked(item: BoxedPicture) -> list[int]:
    """The classes of which the teachers are asked; none where a mask alone describes the picture."""
    if item.exhaustive_mask.ndim == 3:
        return []
    is_loose = item.source in LOOSE_SOURCES
    known = [k for k, name in enumerate(DETECTOR_CLASSES) if name in KNOWN]
    return [k for k in known if is_loose or not item.exhaustive_mask[k]]


def _with_boxes(item: BoxedPicture, rows: _Rows) -> BoxedPicture:
    mask = item.exhaustive_mask
    if item.source in LOOSE_SOURCES:
        mask = np.zeros_like(mask)
    return BoxedPicture(item.source, item.picture, np.array(rows, np.float32).reshape(-1, 5), mask)


def _find_boxes(item: BoxedPicture, teachers: tuple[OffTheShelf, ...]) -> _Rows:
    is_loose, asked = item.source in LOOSE_SOURCES, _asked(item)
    height, width = item.picture.shape[:2]
    size = np.array((width, height, width, height), np.float32)
    found: list[tuple[float, F32]] = []
    for teacher in teachers:
        boxes = teacher.find(item.picture, HINTED_MIN_SCORE if is_loose else LABEL_MIN_SCORE, 50)
        for box, score, kind in zip(boxes.boxes, boxes.scores, boxes.classes, strict=True):
            row = np.array((kind, *(box / size)), np.float32)
            sure = score >= LABEL_MIN_SCORE or _inside_frac(row, item.boxes) >= INSIDE_FRAC
            if kind in asked and sure and (box[2:] > box[:2]).all():
                found.append((float(score), row))
    rows = np.zeros((0, 5), np.float32) if is_loose else item.boxes
    for _, row in sorted(found, key=lambda pair: -pair[0]):
        if iou_matrix(row[None, 1:], rows[:, 1:]).max(initial=0.0) < SAME_OBJECT_IOU:
            rows = np.vstack([rows, row])
    return [(float(k), float(x1), float(y1), float(x2), float(y2)) for k, x1, y1, x2, y2 in rows]


def _inside_frac(row: F32, loose: F32) -> float:
    """Largest share of a box that lies inside one loose box of its class."""
    same = loose[loose[:, 0] == row[0], 1:]
    sides = (np.minimum(row[3:], same[:, 2:]) - np.maximum(row[1:3], same[:, :2])).clip(min=0.0)
    return float(sides.prod(1).max(initial=0.0) / (row[3:] - row[1:3]).prod().clip(min=1e-9))
