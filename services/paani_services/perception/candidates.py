"""What may be a person although no detection says so: boxes that are not sure, and what stands alone in water. Pure."""

import math

import cv2
import numpy as np

from paani.arrays import F32, U8
from paani.boxes import covered_frac, iou
from paani.config import CandidateConfig
from paani.messages import BoxXyxy, Candidate, CandidateKind, Detection, Label
from paani_services.perception.corridors import MIN_VISIBLE_FRAC, WATER

SAME_IOU = 0.45  # C8: of two boxes of one thing
COVERED_FRAC = 0.5  # of a candidate's area, inside the box of what it then is
# Who floats before the bow is large: 0.2 m at a foot in the lowest fifth of the picture are at least this high, seen
# from a camera no more than 1 m above the water through a lens of 70 degrees. Glints and ripples there are smaller.
NEAR_FOOT, NEAR_HEIGHT = 0.80, 0.07
SURROUND_CELLS = 3  # of the mask, beside and below a box


def find_candidates(
    mask: U8,
    confidence: F32,
    visible_frac: F32,
    people: tuple[Detection, ...],
    detections: tuple[Detection, ...],
    config: CandidateConfig,
) -> tuple[Candidate, ...]:
    """What may be a person, at most `max_count`: unsure boxes first, each kind by falling confidence.

    mask, confidence: of the picture as it is, [h, w]. visible_frac: fraction of each cell that is not own hull.
    people: boxes of people by their score alone, with the low threshold. Of those, the ones that are no detection and
    stand in water. Of the mask, obstacles of `min_cells` and more with water all around, that no person's box covers.
    """
    known = [d.box_xyxy for d in detections if d.label is Label.PERSON]
    unsure = [
        _unsure_box(d)
        for d in people
        if is_large_enough(d.box_xyxy)
        and not any(iou(d.box_xyxy, box) > SAME_IOU for box in known)
        and stands_in_water(mask, d.box_xyxy, config.water_share)
    ]
    known += [candidate.box_xyxy for candidate in unsure]
    lone = [
        candidate
        for candidate in find_lone_obstacles(mask, confidence, visible_frac, config.min_cells)
        if is_large_enough(candidate.box_xyxy)
        and not any(covered_frac(candidate.box_xyxy, box) >= COVERED_FRAC for box in known)
    ]
    # Their confidences do not compare: a mask is surer of any buoy than a detector of somebody whom it does not detect.
    return tuple(c for kind in (unsure, lone) for c in sorted(kind, key=lambda c: -c.confidence))[: config.max_count]


def is_reflection(mask: U8, detection: Detection, config: CandidateConfig) -> bool:
    """Whether a box of a person is water alone by the mask, which shows people who are seen that large.

    mask: of the picture as it is, [h, w].
    """
    left, top, right, bottom = detection.box_xyxy
    if detection.label is not Label.PERSON or detection.confidence >= config.reflection_confidence:
        return False
    if bottom - top < config.reflection_height:
        return False
    height, width = mask.shape
    rows, columns = slice(*_cells(top, bottom, height)), slice(*_cells(left, right, width))
    return bool((mask[rows, columns] == WATER).all())


def people_as_candidates(detections: tuple[Detection, ...]) -> tuple[Candidate, ...]:
    """The people among detections that count for nothing, as their picture is unusable: somebody may be there."""
    return tuple(_unsure_box(d) for d in detections if d.label is Label.PERSON)


def _unsure_box(detection: Detection) -> Candidate:
    return Candidate(kind=CandidateKind.UNSURE_BOX, confidence=detection.confidence, box_xyxy=detection.box_xyxy)


def is_large_enough(box: BoxXyxy) -> bool:
    """Whether somebody could be so small there: true of everything that is not before the bow."""
    return box[3] < NEAR_FOOT or box[3] - box[1] >= NEAR_HEIGHT


def stands_in_water(mask: U8, box: BoxXyxy, share: float) -> bool:
    """Whether at least this share of the mask is water on the left, on the right and below the lower half of a box.

    What lies outside the picture is as good as water.
    """
    height, width = mask.shape
    left, right = _cells(box[0], box[2], width)
    top, bottom = _cells((box[1] + box[3]) / 2.0, box[3], height)
    beside = (
        mask[top:bottom, max(0, left - SURROUND_CELLS) : left],
        mask[top:bottom, right : right + SURROUND_CELLS],
        mask[bottom : bottom + SURROUND_CELLS, left:right],
    )
    return all(not part.size or float((part == WATER).mean()) >= share for part in beside)


def find_lone_obstacles(mask: U8, confidence: F32, visible_frac: F32, min_cells: int) -> list[Candidate]:
    """Regions of what is not water that the water surrounds: they meet neither the picture's top nor its bottom.

    A region that meets both sides is a shore; one that meets the bottom is what the boat itself carries.
    """
    height, width = mask.shape
    is_thing = ((mask != WATER) & (visible_frac >= MIN_VISIBLE_FRAC)).astype(np.uint8)
    count, region_of, box_of, _ = cv2.connectedComponentsWithStats(is_thing, connectivity=8)
    found = []
    for region in range(1, count):
        x, y, w, h, cells = box_of[region].tolist()
        if cells < min_cells or y == 0 or y + h == height or w == width:
            continue
        inside = region_of[y : y + h, x : x + w] == region
        sure = float(confidence[y : y + h, x : x + w][inside].max())
        box = (x / width, y / height, (x + w) / width, (y + h) / height)
        found.append(Candidate(kind=CandidateKind.LONE_OBSTACLE, confidence=min(1.0, sure), box_xyxy=box))
    return found


def _cells(start: float, end: float, count: int) -> tuple[int, int]:
    first = min(count - 1, int(start * count))
    return first, min(count, max(first + 1, math.ceil(end * count)))
