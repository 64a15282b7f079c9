"""How many of the small obstacles near the boat are seen, by the mask, by the detector and by either.

The question is that of MODS's danger zone (Bovcon et al. 2021), by its two measures: of a mask an obstacle is found
where at least half of its box is not water, of a detector by a box of IoU 0.3 or more, whatever its class. MODS knows
the zone, water nearer than 15 m, from its camera's calibration. Pictures whose camera is unknown have the paper's own
instead: a box whose foot is as low as that of an immediate danger (G5).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import msgspec
import numpy as np

from paani.arrays import F32, I64, U8, Bools
from paani.config import DetectorConfig, TrackerConfig
from paani.errors import UserError
from paani_models.benchmarks.mods import MIN_OVERLAP
from paani_models.benchmarks.mods_detection import MIN_IOU
from paani_models.datasets.sources import DETECTOR_CLASSES, Sample, read_boxes, read_picture
from paani_models.detector.metrics import Detections, iou_matrix
from paani_models.detector.scores import SCORED_BOXES
from paani_models.report.bootstrap import interval_of_sums
from paani_models.report.height_scores import FindBoxes, Interval
from paani_models.segmenter.scores import WATER

SMALL_FRAC = 1 / 15  # of the picture's height: side of a square of the box's area; COCO's small, 32 px of 480
ZONE_FOOT = TrackerConfig().danger_bottom
SEEN_BY = ("mask", "detector", "either")

Segment = Callable[[U8, tuple[int, ...]], U8]  # a picture, and the shape of the mask -> classes


class SmallObstacles(msgspec.Struct, frozen=True, kw_only=True):
    """Of one class, or of all: true boxes, and which share of them each network sees."""

    kind: str
    boxes: int
    pictures: int
    sequences: int
    recall: dict[str, Interval]


def measure_small_obstacles(samples: Sequence[Sample], segment: Segment, find: FindBoxes) -> list[SmallObstacles]:
    """All classes, then each. Raises UserError where the samples hold no such box, or a file cannot be read."""
    counted: list[tuple[Sample, I64]] = []  # of each picture, by class: boxes, and those seen by each of SEEN_BY
    for sample in samples:
        if sample.label is None:
            continue
        picture = read_picture(sample.picture)
        height, width = picture.shape[:2]
        truth = read_boxes(sample.label) * np.array([1, width, height, width, height], np.float32)
        truth = truth[is_small_and_near(truth[:, 1:], height)]
        if len(truth):
            found = find(picture, min(map(DetectorConfig().threshold, DETECTOR_CLASSES)), SCORED_BOXES)
            seen = see(truth[:, 1:], segment(picture, picture.shape), above_thresholds(found))
            counted.append((sample, count_by_class(truth[:, 0].astype(np.int64), seen)))
    if not counted:
        raise UserError("--sources: no small obstacle near the boat in the held-out pictures")
    kinds = [("all", slice(None)), *((kind, slice(i, i + 1)) for i, kind in enumerate(DETECTOR_CLASSES))]
    return [_row(kind, counted, chosen) for kind, chosen in kinds]


def is_small_and_near(boxes: F32, height_px: int) -> Bools:
    """Of each box, corners [n,4] in a picture of this height."""
    side_px = np.sqrt((boxes[:, 2] - boxes[:, 0]) * (boxes[:, 3] - boxes[:, 1]))
    return np.asarray((side_px < SMALL_FRAC * height_px) & (boxes[:, 3] >= ZONE_FOOT * height_px), np.bool_)


def above_thresholds(found: Detections) -> F32:
    """The boxes that the board keeps, corners [n,4]."""
    threshold = np.array([DetectorConfig().threshold(kind) for kind in DETECTOR_CLASSES])
    return np.asarray(found.boxes[found.scores > threshold[found.classes]], np.float32)


def see(boxes: F32, label: U8, found: F32) -> Bools:
    """Which true boxes are seen by each of SEEN_BY, bool [n,3]. label: classes [H,W]. found: corners [m,4]."""
    shared = iou_matrix(boxes, found)
    by_mask = [bool((label[_inside(box, label.shape)] != WATER).mean() >= MIN_OVERLAP) for box in boxes]
    by_boxes = (shared >= MIN_IOU).any(1) if len(found) else np.zeros(len(boxes), np.bool_)
    return np.stack([by_mask, by_boxes, np.asarray(by_mask) | by_boxes], 1)


def count_by_class(classes: I64, seen: Bools) -> I64:
    """Boxes, and those seen by each of SEEN_BY, of each class [classes, 4]."""
    counts = np.zeros((len(DETECTOR_CLASSES), 1 + len(SEEN_BY)), np.int64)
    np.add.at(counts, classes, np.hstack([np.ones((len(seen), 1), np.int64), seen]))
    return counts


def format_small_obstacles(rows: Sequence[SmallObstacles]) -> str:
    """A line for each class that occurs, after one that says what is counted."""
    lines = [
        f"Boxes smaller than a square of {SMALL_FRAC:.3f} of the picture's height, with their foot below {ZONE_FOOT:g} "
        "of it; recall with its 95 % interval over sequences.",
        "  ".join(("class    boxes  pictures  sequences", *(f"{name:22}" for name in SEEN_BY))).rstrip(),
    ]
    for row in rows:
        if row.boxes:
            head = f"{row.kind:7}  {row.boxes:5}  {row.pictures:8}  {row.sequences:9}"
            spans = (f"{x.value:.3f} [{x.low:.3f}, {x.high:.3f}]" for x in row.recall.values())
            lines.append("  ".join((head, *(f"{span:22}" for span in spans))).rstrip())
    return "\n".join(lines) + "\n"


def _inside(box: F32, shape: tuple[int, ...]) -> tuple[slice, slice]:
    """The pixels of a box, at least one."""
    x1, y1, x2, y2 = np.round(box).astype(int)
    x1, y1 = min(max(0, x1), shape[1] - 1), min(max(0, y1), shape[0] - 1)
    return slice(y1, max(y1 + 1, y2)), slice(x1, max(x1 + 1, x2))


def _row(kind: str, counted: Sequence[tuple[Sample, I64]], chosen: slice) -> SmallObstacles:
    sums: dict[str, I64] = {}
    pictures = 0
    for sample, counts in counted:
        of_kind = counts[chosen].sum(0)
        if of_kind[0]:
            pictures += 1
            sequence = f"{sample.source.name}/{sample.sequence}"
            sums[sequence] = sums.get(sequence, np.zeros_like(of_kind)) + of_kind
    each = np.array(list(sums.values()), np.int64).reshape(-1, 1 + len(SEEN_BY))
    total = each.sum(0)
    recall = {}
    for column, name in enumerate(SEEN_BY, start=1):

        def share(counts: I64, column: int = column) -> float:
            return float(counts[column] / counts[0]) if counts[0] else float("nan")

        recall[name] = Interval(share(total), *interval_of_sums(each, share))
    return SmallObstacles(kind=kind, boxes=int(total[0]), pictures=pictures, sequences=len(each), recall=recall)
