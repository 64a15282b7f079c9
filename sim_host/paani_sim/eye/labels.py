"""From the label picture to a class mask and boxes of visible pixels. Pure numpy."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from paani_sim.eye.scene import FIRST_THING, SKY, WATER, Thing
from paani_sim.worlds.world import Kind

OBSTACLE_CODE, WATER_CODE, SKY_CODE = 0, 1, 2
CLASSES = (Kind.PERSON, Kind.VESSEL, Kind.PIER, Kind.BUOY)
MIN_SIDE_PX = 3
MIN_PIXELS = 10

U8 = npt.NDArray[np.uint8]
F32 = npt.NDArray[np.float32]


class VisibleBox(NamedTuple):
    """Where a thing is visible: pixel edges, right and bottom exclusive."""

    id: str
    kind: Kind
    x0_px: int
    y0_px: int
    x1_px: int
    y1_px: int
    visible_px: int


@dataclass(frozen=True, eq=False)
class Labelled:
    """A picture with `mask` `(h, w)` uint8 (0 obstacle, 1 water, 2 sky), visible boxes and depth.

    `depth_m` `(h, w)` float32 is the distance along the camera's axis, infinite for the sky.
    """

    bgr: U8
    mask: U8
    boxes: tuple[VisibleBox, ...]
    depth_m: F32


def read_labels(bgr: U8, labels: U8, depth_m: F32, things: Sequence[Thing]) -> Labelled:
    """Decode a label picture `(h, w, 4)`: a number's low byte first, then its high byte."""
    number = labels[..., 0].astype(np.int32) + 256 * labels[..., 1].astype(np.int32)
    mask = np.full(number.shape, OBSTACLE_CODE, np.uint8)
    mask[number == WATER] = WATER_CODE
    mask[number == SKY] = SKY_CODE
    seen = set(np.unique(number).tolist())
    crew = {t.part_of for t in things if t.part_of and t.number in seen}
    boxes = []
    for thing in things:
        if thing.kind not in CLASSES or thing.number < FIRST_THING:
            continue
        numbers = [thing.number]
        if thing.id in crew:
            numbers += [t.number for t in things if t.part_of == thing.id]
        if not seen.intersection(numbers):
            continue
        box = _box(np.isin(number, numbers))
        if box is not None:
            boxes.append(VisibleBox(thing.id, thing.kind, *box))
    return Labelled(bgr, mask, tuple(boxes), depth_m)


def _box(visible: npt.NDArray[np.bool_]) -> tuple[int, int, int, int, int] | None:
    rows, columns = np.flatnonzero(visible.any(axis=1)), np.flatnonzero(visible.any(axis=0))
    pixels = int(np.count_nonzero(visible))
    x0, y0, x1, y1 = int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1
    if pixels < MIN_PIXELS or x1 - x0 < MIN_SIDE_PX or y1 - y0 < MIN_SIDE_PX:
        return None
    return x0, y0, x1, y1, pixels
