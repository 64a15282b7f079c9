"""Class scores of the mask to three corridors of water (E1-E7). Pure.

A cell is 4x4 pixels of the answer. Its score is what a net that ends with a fourfold resize gave before it; of any
other answer, the pixel to the right of and below the cell's middle.
"""

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from paani.arrays import F32, U8
from paani.config import CorridorConfig
from paani.messages import LaneEvidence

STRIDE, MIDDLE = 4, 2
MIN_ROWS = 32
MIN_COUNTED = 0.5  # a corridor of which less can be seen is unknown, which is blocked
WATER, OBSTACLE, SKY = 0, 1, 2  # D6
# Glints of the sun near the boat: 2 or 3 cells there are 0.15 m seen from 1 m, and no swimmer's head seen from 5 m.
SPECK_CELLS, SPECKS_BELOW = 3, 2.0 / 3.0


class Lanes(NamedTuple):
    left: LaneEvidence
    center: LaneEvidence
    right: LaneEvidence


def cells_only(shape: tuple[int, ...]) -> tuple[int, ...] | None:
    """Shape [1, C, h, w] of the cells of an answer [1, C, H, W]; None where `classify` does not take them for cells."""
    if len(shape) != 4:
        return None
    cells = (*shape[:2], shape[2] // STRIDE, shape[3] // STRIDE)
    return cells if cells[2] < STRIDE * MIN_ROWS <= shape[2] else None


def classify(logits: F32, temperature: float) -> tuple[U8, F32]:
    """Class mask and confidence of each cell (E1).

    logits: float32 [1, 3, H, W] of water, obstacle, sky. Returns uint8 and float32 [h, w]: argmax and largest softmax
    probability of each cell's score. Where there are few rows, each is a cell.
    """
    cells = logits[0, :, MIDDLE::STRIDE, MIDDLE::STRIDE] if logits.shape[2] >= STRIDE * MIN_ROWS else logits[0]
    scores = cells / np.float32(temperature)
    largest = scores.max(axis=0)
    confidence = 1.0 / np.exp(scores - largest).sum(axis=0)
    return scores.argmax(axis=0).astype(np.uint8), confidence.astype(np.float32)


def summarise(mask: U8, confidence: F32, corridors: CorridorConfig, counts: F32 | None = None) -> Lanes:
    """N_j, U_j and clear width of each corridor, cells at its border counted by the part inside.

    counts: how much of each cell counts (own hull and what lies outside the picture do not); None: everything.
    A corridor of which less than half counts is blocked.
    """
    rows = shares(mask.shape[0], corridors.top, 1.0)
    counts = np.ones(mask.shape, np.float32) if counts is None else counts
    seen = counts.astype(np.float64)
    water = (mask == WATER) * seen
    return Lanes(
        *(
            _lane(water, confidence * seen, seen, rows, shares(mask.shape[1], *span), corridors.clear_column)
            for span in (corridors.left, corridors.center, corridors.right)
        )
    )


def water_edge(mask: U8, counts: F32) -> tuple[float, ...]:
    """Where the water that begins at the picture's bottom ends, for each column: see `Evidence.water_edge`.

    mask: uint8 [h, w], as the picture is, not levelled. counts: how much of each cell is not own hull, [h, w].
    A column of nothing but own hull has no water. Specks with water all round end nothing: see `SPECK_CELLS`.
    """
    height = mask.shape[0]
    hull = counts < MIN_COUNTED
    ends = _without_specks((mask != WATER) & ~hull)
    lowest = height - ends[::-1].argmax(axis=0)  # its lower edge, in cells from the top
    edge = np.where(ends.any(axis=0), lowest, np.where(hull.all(axis=0), height, 0))
    return tuple((edge / height).tolist())


def _without_specks(ends: NDArray[np.bool_]) -> NDArray[np.bool_]:
    count, part_of, box, _ = cv2.connectedComponentsWithStats(ends.astype(np.uint8), connectivity=8)
    is_speck = (box[:, cv2.CC_STAT_AREA] <= SPECK_CELLS) & (box[:, cv2.CC_STAT_TOP] >= SPECKS_BELOW * ends.shape[0])
    return ends & ~is_speck[part_of] if count > 1 else ends


def shares(cells: int, start: float, end: float) -> NDArray[np.float64]:
    """How much of each of `cells` equal cells of [0, 1] lies in [start, end]: [cells] in [0, 1]."""
    edges = np.arange(cells + 1) / cells
    inside = np.minimum(edges[1:], end) - np.maximum(edges[:-1], start)
    return np.asarray(np.clip(inside, 0.0, None) * cells, np.float64)


def _lane(
    water: NDArray[np.float64],
    confidence: NDArray[np.float64],
    seen: NDArray[np.float64],
    rows: NDArray[np.float64],
    columns: NDArray[np.float64],
    clear_column: float,
) -> LaneEvidence:
    seen_of_column = rows @ seen
    total = float(seen_of_column @ columns)
    if total < MIN_COUNTED * rows.sum() * columns.sum():
        return LaneEvidence()
    water_of_column = rows @ water
    non_water = 1.0 - float(water_of_column @ columns) / total  # E4
    uncertainty = 1.0 - float(rows @ confidence @ columns) / total  # E5
    best = run = 0.0
    clear = (seen_of_column > 0.0) & (water_of_column >= (clear_column - 1e-12) * seen_of_column)
    for is_clear, width in zip(clear.tolist(), columns.tolist(), strict=True):
        run = run + width if width > 0.0 and is_clear else 0.0
        best = max(best, run)
    return LaneEvidence(
        non_water=min(1.0, max(0.0, non_water)),
        uncertainty=min(1.0, max(0.0, uncertainty)),
        clear_width=min(1.0, best / float(columns.sum())),  # E6
    )
