"""Semantic protocol of the LaRS benchmark (Zust et al. 2023): mIoU, mu, Pr, Re, F1 and Q, and its formats.

Written from the description of the protocol. Classes here are LaRS's: obstacle 0, water 1, sky 2, 255 ignored.

    ROOT/image_list.txt, images/NAME.jpg, semantic_masks/NAME.png, panoptic_masks/NAME.png, panoptic_annotations.json
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import cv2
import msgspec
import numpy as np
from numpy.typing import NDArray

from paani.arrays import U8, Bools
from paani.errors import UserError
from paani.undecodable import UNREADABLE
from paani_models.datasets.checked_files import decode_picture, read_whole_file
from paani_models.datasets.sources import IGNORE
from paani_models.segmenter.metrics import class_iou, confusion_matrix

OBSTACLE, WATER, SKY = 0, 1, 2
COLOURS = ((247, 195, 37), (41, 167, 224), (90, 75, 164))  # RGB; what the benchmark's server reads
STATIC_OBSTACLE = 1
DYNAMIC = frozenset({11, 12, 13, 14, 15, 16, 17, 19})
EDGE_DILATION_PX = 11
OBJECT_DILATION_PX = 7
WATER_EROSION_PX = 21
MIN_COVERAGE = 0.7

_FROM_OURS = np.array([WATER, OBSTACLE, SKY], np.uint8)  # our classes are water 0, obstacle 1, sky 2


class Segment(msgspec.Struct, frozen=True):
    """One panoptic segment; its pixels carry `id` as R + 256 G + 65536 B."""

    id: int
    category_id: int


class _Image(msgspec.Struct, frozen=True):
    id: int
    file_name: str


class _Annotation(msgspec.Struct, frozen=True):
    image_id: int
    segments_info: tuple[Segment, ...]


class _Panoptic(msgspec.Struct, frozen=True):
    images: tuple[_Image, ...]
    annotations: tuple[_Annotation, ...]


@dataclass(frozen=True)
class Truth:
    """One annotated picture: semantic [H,W], panoptic RGB [H,W,3], and its segments."""

    semantic: U8
    panoptic: U8
    segments: tuple[Segment, ...]


@dataclass
class LarsTally:
    """Counts over a data set."""

    counts: NDArray[np.int64] = field(default_factory=lambda: np.zeros((3, 3), np.int64))
    edge_right: int = 0
    edge: int = 0
    found: int = 0
    missed: int = 0
    alarms: int = 0

    def add(self, predicted: U8, truth: Truth) -> None:
        """Count one picture. predicted: LaRS classes, any size; resized to the truth's, nearest pixel."""
        height, width = truth.semantic.shape
        label = np.asarray(cv2.resize(predicted, (width, height), interpolation=cv2.INTER_NEAREST_EXACT), np.uint8)
        self.counts += confusion_matrix(label, truth.semantic, 3)
        static, water = truth.panoptic[..., 0] == STATIC_OBSTACLE, truth.semantic == WATER
        obstacle = label == OBSTACLE
        ids = truth.panoptic.astype(np.int64) @ np.array([1, 256, 65536])
        dynamic = np.zeros(label.shape, np.bool_)
        for segment in truth.segments:
            if segment.category_id not in DYNAMIC:
                continue
            mine = ids == segment.id
            around = _dilate(mine, OBJECT_DILATION_PX)
            dynamic |= around
            if (obstacle & ~static & around).sum() > MIN_COVERAGE * mine.sum():
                self.found += 1
            else:
                self.missed += 1
        edge = _dilate(static, EDGE_DILATION_PX) & _dilate(water, EDGE_DILATION_PX) & (static | water) & ~dynamic
        self.edge += int(edge.sum())
        self.edge_right += int((edge & (label == truth.semantic)).sum())
        alarms = (obstacle & _erode(water, WATER_EROSION_PX)).astype(np.uint8)
        self.alarms += cv2.connectedComponents(alarms, connectivity=8)[0] - 1

    def figures(self) -> dict[str, float]:
        """In percent; NaN for `mu` without a water edge."""
        iou = class_iou(self.counts) * 100
        precision = self.found / (self.found + self.alarms) if self.found + self.alarms else 0.0
        recall = self.found / (self.found + self.missed) if self.found + self.missed else 0.0
        both = 2 * precision * recall / (precision + recall) if precision + recall else 0.0
        mean = float(np.nanmean(iou))
        return {
            "miou": mean,
            "iou_obstacle": float(iou[OBSTACLE]),
            "iou_water": float(iou[WATER]),
            "iou_sky": float(iou[SKY]),
            "mu": 100.0 * self.edge_right / self.edge if self.edge else float("nan"),
            "pr": 100.0 * precision,
            "re": 100.0 * recall,
            "f1": 100.0 * both,
            "q": mean * both,
        }


def to_lars_classes(label: U8) -> U8:
    """Our classes 0..2 -> LaRS's."""
    return _FROM_OURS[label]


def colour_label(label: U8) -> U8:
    """LaRS classes -> the RGB picture that the server reads, uint8 [H,W,3]."""
    return np.array(COLOURS, np.uint8)[label]


def write_prediction(folder: Path, name: str, label: U8) -> None:
    """Write `folder`/NAME.png in the server's colours. label: our classes."""
    path = folder / f"{name}.png"
    path.parent.mkdir(parents=True, exist_ok=True)
    if not cv2.imwrite(str(path), cv2.cvtColor(colour_label(to_lars_classes(label)), cv2.COLOR_RGB2BGR)):
        raise UserError(f"{path}: cannot be written")


def read_prediction(path: Path) -> U8:
    """A picture in the server's colours -> LaRS classes. Raises UserError naming one unreadable or of other colours."""
    picture = decode_picture(read_whole_file(path), path)
    label = np.full(picture.shape[:2], IGNORE, np.uint8)
    for kind, colour in enumerate(COLOURS):
        label[(picture == colour).all(2)] = kind
    if (label == IGNORE).any():
        raise UserError(f"{path}: holds other colours than the three")
    return label


def read_names(root: Path) -> tuple[str, ...]:
    """Pictures of the list, in order. Raises UserError naming a list that is missing or empty."""
    path = root / "image_list.txt"
    try:
        names = tuple(line.strip() for line in path.read_text(encoding="utf-8").splitlines() if line.strip())
    except (OSError, UnicodeDecodeError) as error:
        raise UserError(f"{path}: {error}") from error
    if not names:
        raise UserError(f"{path}: names no picture")
    return names


def read_segments(root: Path) -> dict[str, tuple[Segment, ...]]:
    """Segments by picture name. Raises UserError naming a file that is missing or malformed."""
    path = root / "panoptic_annotations.json"
    try:
        panoptic = msgspec.json.decode(path.read_bytes(), type=_Panoptic)
    except UNREADABLE as error:
        raise UserError(f"{path}: {error}") from error
    names = {image.id: Path(image.file_name).stem for image in panoptic.images}
    return {names[each.image_id]: each.segments_info for each in panoptic.annotations if each.image_id in names}


def read_truth(root: Path, name: str, segments: dict[str, tuple[Segment, ...]]) -> Truth:
    """Raises UserError naming a mask that is missing or unreadable, or a picture without panoptic annotation."""
    if name not in segments:
        raise UserError(f"{root / 'panoptic_annotations.json'}: does not annotate {name}")
    paths = [root / folder / f"{name}.png" for folder in ("semantic_masks", "panoptic_masks")]
    semantic, panoptic = (decode_picture(read_whole_file(path), path) for path in paths)
    if semantic.shape != panoptic.shape:
        raise UserError(f"{paths[1]}: another size than {paths[0].name} of semantic_masks")
    return Truth(semantic[..., 0], panoptic, segments[name])


def _dilate(mask: Bools, side: int) -> Bools:
    return np.asarray(cv2.dilate(mask.astype(np.uint8), np.ones((side, side), np.uint8)), np.bool_)


def _erode(mask: Bools, side: int) -> Bools:
    return np.asarray(cv2.erode(mask.astype(np.uint8), np.ones((side, side), np.uint8)), np.bool_)
