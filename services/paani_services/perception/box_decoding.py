"""Raw detector output to boxes in the picture (C4-C10). Pure."""

import numpy as np
from numpy.typing import NDArray

from paani.arrays import F32
from paani.config import DetectorConfig
from paani.messages import Detection, Label
from paani_services.perception.preprocess import Letterbox

LABELS = tuple(Label)
MIN_SIDE = 1e-4  # normalised; a box thinner than this has no size to speak of


def decode(
    output: F32, place: Letterbox, config: DetectorConfig, classes: tuple[str, ...] = LABELS
) -> tuple[Detection, ...]:
    """Boxes by falling confidence.

    classes: what each score row stands for; a row that is none of our labels is left out.

    output: float32 [1, 4 + classes, N], rows cx, cy, w, h in net pixels, then scores in [0, 1]. Non-finite
    candidates are dropped (C5), the threshold is exclusive (C6), at most `nms_input` go into class-agnostic
    suppression (C7, C8), at most `max_boxes` come out (C9), in normalised source coordinates (C10).
    """
    rows = output[0]
    if classes != LABELS:
        known = [i for i, name in enumerate(classes) if name in LABELS]
        labels = [Label(classes[i]) for i in known]
        rows = rows[[0, 1, 2, 3, *(4 + i for i in known)]]
    else:
        labels = list(LABELS)
    with np.errstate(invalid="ignore"):
        confidence = rows[4:].max(axis=0)
        keep = np.flatnonzero(np.isfinite(rows).all(axis=0) & (confidence > config.confidence))
    ranked = keep[np.argsort(-confidence[keep], kind="stable")][: config.nms_input]
    boxes = in_picture(rows[:4, ranked], place)
    solid = (boxes[2] - boxes[0] > MIN_SIDE) & (boxes[3] - boxes[1] > MIN_SIDE)
    ranked, boxes = ranked[solid], boxes[:, solid]
    chosen = suppress(boxes, config.nms_iou)[: config.max_boxes]
    kinds = rows[4:, ranked].argmax(axis=0)
    return tuple(
        Detection(
            label=labels[int(kinds[i])],
            confidence=min(1.0, float(confidence[ranked[i]])),
            box_xyxy=(float(boxes[0, i]), float(boxes[1, i]), float(boxes[2, i]), float(boxes[3, i])),
        )
        for i in chosen
    )


def in_picture(centred: F32, place: Letterbox) -> NDArray[np.float64]:
    """cx, cy, w, h in net pixels [4, n] to normalised x1, y1, x2, y2 [4, n], cut at the picture's edges."""
    cx, cy, w, h = centred.astype(np.float64)
    x = np.stack((cx - w / 2, cx + w / 2))
    y = np.stack((cy - h / 2, cy + h / 2))
    x = (x - place.left_px) / (place.scale_x * place.source_w_px)
    y = (y - place.top_px) / (place.scale_y * place.source_h_px)
    return np.asarray(np.clip(np.stack((x[0], y[0], x[1], y[1])), 0.0, 1.0), np.float64)


def suppress(boxes: NDArray[np.float64], max_iou: float) -> list[int]:
    """Greedy suppression, whatever the class: indices kept, in the order given. boxes: xyxy [4, n], best first."""
    x1, y1, x2, y2 = boxes
    areas = (x2 - x1) * (y2 - y1)
    width = np.minimum(x2[:, None], x2) - np.maximum(x1[:, None], x1)
    height = np.minimum(y2[:, None], y2) - np.maximum(y1[:, None], y1)
    both = np.clip(width, 0.0, None) * np.clip(height, 0.0, None)
    overlaps = both > max_iou * (areas[:, None] + areas - both)
    alive = np.ones(len(areas), bool)
    kept: list[int] = []
    for i in range(len(areas)):
        if alive[i]:
            kept.append(i)
            alive &= ~overlaps[i]
    return kept
