"""Detector output to boxes in the picture: confidence threshold, then non-maximum suppression (C4-C10). Pure."""

import msgspec
import numpy as np
from numpy.typing import NDArray

from paani.arrays import F32
from paani.config import DetectorConfig
from paani.messages import Detection, Label
from paani_services.perception.preprocessing import LetterboxTransform

LABELS = tuple(Label)
MIN_SIDE = 1e-4  # fraction of the picture; a thinner box has no usable size


def decode_boxes(
    output: F32, transform: LetterboxTransform, config: DetectorConfig, classes: tuple[str, ...] = LABELS
) -> tuple[Detection, ...]:
    """Detections in order of falling confidence.

    output: float32 [1, 4 + classes, N], rows cx, cy, w, h in pixels of the network's input, then scores in [0, 1].
    transform: from the picture to that input. classes: what each score row stands for; rows of classes that are no
    `Label` are ignored.
    Candidates with a number that is not finite are dropped (C5), thresholds are exclusive (C6), and a candidate is of
    the class that scores highest among those above their own. At most `nms_input` candidates enter the suppression,
    which ignores classes (C7, C8), and at most `max_boxes` boxes leave it (C9), in normalised coordinates of the
    picture (C10).
    """
    rows = output[0]
    if classes != LABELS:
        known = [i for i, name in enumerate(classes) if name in LABELS]
        labels = [Label(classes[i]) for i in known]
        rows = rows[[0, 1, 2, 3, *(4 + i for i in known)]]
    else:
        labels = list(LABELS)
    thresholds = np.array([[config.threshold(label.value)] for label in labels], np.float32)
    with np.errstate(invalid="ignore"):
        scores = np.where(rows[4:] > thresholds, rows[4:], 0.0)
        confidence = scores.max(axis=0, initial=0.0)
        valid = np.flatnonzero(np.isfinite(rows).all(axis=0) & (confidence > 0.0))
    ranked = valid[np.argsort(-confidence[valid], kind="stable")][: config.nms_input]
    boxes = to_picture_coordinates(rows[:4, ranked], transform)
    has_size = (boxes[2] - boxes[0] > MIN_SIDE) & (boxes[3] - boxes[1] > MIN_SIDE)
    ranked, boxes = ranked[has_size], boxes[:, has_size]
    kept = suppress_overlaps(boxes, config.nms_iou)[: config.max_boxes]
    best_class = scores[:, ranked].argmax(axis=0)
    return tuple(
        Detection(
            label=labels[int(best_class[i])],
            confidence=min(1.0, float(confidence[ranked[i]])),
            box_xyxy=(float(boxes[0, i]), float(boxes[1, i]), float(boxes[2, i]), float(boxes[3, i])),
        )
        for i in kept
    )


def decode_people(
    output: F32, transform: LetterboxTransform, config: DetectorConfig, above: float, classes: tuple[str, ...] = LABELS
) -> tuple[Detection, ...]:
    """People by their own score alone, whatever else scores higher in the same place, above a threshold of their own.

    Otherwise as `decode_boxes`; empty where the detector has no class person.
    """
    if Label.PERSON not in classes:
        return ()
    person = output[:, [0, 1, 2, 3, 4 + classes.index(Label.PERSON)]]
    return decode_boxes(person, transform, msgspec.structs.replace(config, person_confidence=above), (Label.PERSON,))


def to_picture_coordinates(centred: F32, transform: LetterboxTransform) -> NDArray[np.float64]:
    """cx, cy, w, h in input pixels [4, n] to normalised x1, y1, x2, y2 [4, n], cut at the picture's edges."""
    cx, cy, w, h = centred.astype(np.float64)
    x = np.stack((cx - w / 2, cx + w / 2))
    y = np.stack((cy - h / 2, cy + h / 2))
    x = (x - transform.left_px) / (transform.scale_x * transform.source_w_px)
    y = (y - transform.top_px) / (transform.scale_y * transform.source_h_px)
    return np.asarray(np.clip(np.stack((x[0], y[0], x[1], y[1])), 0.0, 1.0), np.float64)


def suppress_overlaps(boxes: NDArray[np.float64], max_iou: float) -> list[int]:
    """Greedy non-maximum suppression, whatever the class: indices of the boxes kept, in the order given.

    boxes: xyxy [4, n], most confident first.
    """
    x1, y1, x2, y2 = boxes
    areas = (x2 - x1) * (y2 - y1)
    width = np.minimum(x2[:, None], x2) - np.maximum(x1[:, None], x1)
    height = np.minimum(y2[:, None], y2) - np.maximum(y1[:, None], y1)
    intersection = np.clip(width, 0.0, None) * np.clip(height, 0.0, None)
    overlaps = intersection > max_iou * (areas[:, None] + areas - intersection)
    is_candidate = np.ones(len(areas), bool)
    kept: list[int] = []
    for i in range(len(areas)):
        if is_candidate[i]:
            kept.append(i)
            is_candidate &= ~overlaps[i]
    return kept
