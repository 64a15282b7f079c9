"""Decodes the label picture into a class mask and boxes of visible pixels. Pure numpy."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from paani.arrays import F32, U8
from paani_sim.eye.scene import FIRST_THING, SKY, WATER, Thing
from paani_sim.worlds.world import Kind

OBSTACLE_CODE, WATER_CODE, SKY_CODE = 0, 1, 2
CLASSES = (Kind.PERSON, Kind.VESSEL, Kind.PIER, Kind.BUOY)
MIN_SIDE_PX = 3
MIN_PIXELS = 10
MIN_CONTRAST = 9.0  # of 255: below it neither colour nor brightness tells a thing from what is around it
MIN_FILLED = 0.06  # of a box: less are specks behind leaves and railings
SURROUND_PX = 3


class VisibleBox(NamedTuple):
    """Where a thing is visible: pixel edges, right and bottom exclusive; how many pixels, and how far they stand out.

    `contrast` (0..255) is the larger of two: how far the median colour of its pixels is from that of the others in and
    around the box, in any channel; half of how far its brightest or darkest are from their brightness.
    """

    id: str
    kind: Kind
    x0_px: int
    y0_px: int
    x1_px: int
    y1_px: int
    visible_px: int
    contrast: float


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
        own = np.isin(number, numbers)
        box = _box(own)
        if box is not None:
            boxes.append(VisibleBox(thing.id, thing.kind, *box, _contrast(bgr, own, box[:4])))
    return Labelled(bgr, mask, tuple(boxes), depth_m)


def select_visible_boxes(view: Labelled) -> tuple[VisibleBox, ...]:
    """The boxes of things that stand out from what is around them: fog, dusk, rain and reeds hide the others."""
    return tuple(box for box in view.boxes if box.contrast >= MIN_CONTRAST and _filled_frac(box) >= MIN_FILLED)


def _filled_frac(box: VisibleBox) -> float:
    return box.visible_px / ((box.x1_px - box.x0_px) * (box.y1_px - box.y0_px))


def _contrast(bgr: U8, own: npt.NDArray[np.bool_], edges: tuple[int, int, int, int]) -> float:
    height, width = own.shape
    x0, y0 = max(0, edges[0] - SURROUND_PX), max(0, edges[1] - SURROUND_PX)
    x1, y1 = min(width, edges[2] + SURROUND_PX), min(height, edges[3] + SURROUND_PX)
    there, pixels = own[y0:y1, x0:x1], bgr[y0:y1, x0:x1].astype(np.float32)
    inside, around = pixels[there], pixels[~there]
    if len(around) == 0:
        return 255.0
    apart = np.abs(np.median(inside, axis=0) - np.median(around, axis=0)).max()
    low, high = np.percentile(inside.mean(axis=1), [10, 90])
    level = np.median(around.mean(axis=1))
    return float(max(apart, 0.5 * (high - level), 0.5 * (level - low)))


def _box(visible: npt.NDArray[np.bool_]) -> tuple[int, int, int, int, int] | None:
    rows, columns = np.flatnonzero(visible.any(axis=1)), np.flatnonzero(visible.any(axis=0))
    pixels = int(np.count_nonzero(visible))
    x0, y0, x1, y1 = int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1
    if pixels < MIN_PIXELS or x1 - x0 < MIN_SIDE_PX or y1 - y0 < MIN_SIDE_PX:
        return None
    return x0, y0, x1, y1, pixels
