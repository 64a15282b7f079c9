"""What the annotations of a picture say of the way ahead: a person, a vessel, open water. Pure."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from paani.arrays import F32, U8
from paani.config import CorridorConfig
from paani_models.datasets.sources import DETECTOR_CLASSES, IGNORE

PERSON, VESSEL = DETECTOR_CLASSES.index("person"), DETECTOR_CLASSES.index("vessel")
WATER = 0  # D6
MIN_HEIGHT = 0.10  # of the picture: who is smaller is far off, or seen from a shore camera
# Open water: of the centre's water, from the lower edge to where it ends, the part next to the far shore says nothing.
MIN_WATER_HEIGHT, FAR_SHARE, MIN_OPEN_SHARE = 0.30, 0.15, 0.97
NOT_WATER = 0.80  # of a lane; whoever advises one that shows less water advises land


class Ahead(NamedTuple):
    """What is ahead by the annotations; each False where nothing of the kind is annotated."""

    person: bool
    vessel: bool
    open_water: bool


def annotated_ahead(boxes: F32 | None, mask: U8 | None, corridors: CorridorConfig) -> Ahead:
    """What is ahead in one picture.

    boxes: float32 [n, 5] of class, x1, y1, x2, y2, normalised; None where none are annotated. mask: classes uint8
    [H, W] (water 0, 255 undecided), or None. Ahead is a box of `MIN_HEIGHT` and more, whose middle lies in the centre
    corridor and whose foot lies below the corridors' top. Open water needs a mask, and nothing boxed in the centre.
    """
    person = vessel = False
    is_open = mask is not None and shows_open_water(mask, corridors)
    for kind, x1, y1, x2, y2 in [] if boxes is None else boxes.tolist():
        if y2 <= corridors.top or min(x2, corridors.center[1]) <= max(x1, corridors.center[0]):
            continue
        is_open = False
        if y2 - y1 >= MIN_HEIGHT and corridors.center[0] < (x1 + x2) / 2 < corridors.center[1]:
            person, vessel = person or kind == PERSON, vessel or kind == VESSEL
    return Ahead(person, vessel, is_open)


def shows_open_water(mask: U8, corridors: CorridorConfig) -> bool:
    """Whether the centre corridor is water from the picture's lower edge to near the far shore."""
    height = mask.shape[0]
    centre = _columns(mask, corridors.center)
    rows = np.flatnonzero((centre == WATER).any(axis=1))
    if not rows.size or height - rows[0] < MIN_WATER_HEIGHT * height:
        return False
    near = centre[rows[0] + round(FAR_SHARE * (height - rows[0])) :]
    decided = near[near != IGNORE]
    return bool(decided.size) and float((decided == WATER).mean()) >= MIN_OPEN_SHARE


def not_water_share(mask: U8, span: tuple[float, float], top: float) -> float:
    """The share of a corridor that people marked as no water; 0 where they decided nothing."""
    lane = _columns(mask[round(top * mask.shape[0]) :], span)
    decided = lane[lane != IGNORE]
    return float((decided != WATER).mean()) if decided.size else 0.0


def _columns(mask: U8, span: tuple[float, float]) -> U8:
    return mask[:, round(span[0] * mask.shape[1]) : round(span[1] * mask.shape[1])]
