"""Segmenter output to a class mask, three corridors of water and the water's edge (E1-E7). Pure.

A mask has 64 x 80 cells, each 4 x 4 pixels of the shipped segmenter's output. A segmenter that ends with a fourfold
resize gives the cells' scores before it; else the pixel right of and below the cell's middle is taken.
"""

from typing import NamedTuple

import cv2
import msgspec
import numpy as np
from numpy.typing import NDArray

from paani.arrays import F32, U8
from paani.config import CorridorConfig
from paani.messages import LaneEvidence

CELL_PX, CELL_MIDDLE_PX = 4, 2  # side of a cell, and the pixel of it that is taken
MASK_HW = (64, 80)  # cells of a mask
MIN_VISIBLE_FRAC = 0.5  # a corridor of which less is visible is unknown, and so blocked
BOW_ROWS_FRAC = 0.2  # of the picture, from its lower edge: where water begins that the boat floats in
WATER, OBSTACLE, SKY = 0, 1, 2  # D6
# Specks are glints of the sun near the boat: regions of at most this many cells, whose top lies in the lowest third of
# the picture. Two or three cells there are 0.15 m seen from 1 m, and no swimmer's head seen from 5 m.
SPECK_MAX_CELLS, SPECK_MIN_TOP_FRAC = 3, 2.0 / 3.0


class CorridorEvidence(NamedTuple):
    """Evidence of the three corridors."""

    left: LaneEvidence
    center: LaneEvidence
    right: LaneEvidence


def cell_shape(shape: tuple[int, ...]) -> tuple[int, ...] | None:
    """Shape [1, C, h, w] of the cells of an output [1, C, H, W]; None where `classify_cells` does not take cells."""
    if len(shape) != 4:
        return None
    cells = (*shape[:2], shape[2] // CELL_PX, shape[3] // CELL_PX)
    return cells if cells[2:] == MASK_HW else None


def classify_cells(logits: F32, temperature: float) -> tuple[U8, F32]:
    """Class mask uint8 and confidence float32 [64, 80]: argmax and largest softmax probability of each cell (E1).

    logits: float32 [1, 3, H, W] of water, obstacle, sky: of the cells, of four pixels to each side of one, or of any
    other size, which is scaled to the cells.
    """
    size_hw = logits.shape[2:]
    if size_hw == (CELL_PX * MASK_HW[0], CELL_PX * MASK_HW[1]):
        cells = logits[0, :, CELL_MIDDLE_PX::CELL_PX, CELL_MIDDLE_PX::CELL_PX]
    elif size_hw == MASK_HW:
        cells = logits[0]
    else:
        scores_of = np.ascontiguousarray(logits[0].transpose(1, 2, 0))
        cells = cv2.resize(scores_of, MASK_HW[::-1], interpolation=cv2.INTER_LINEAR).transpose(2, 0, 1)
    scores = cells / np.float32(temperature)
    largest = scores.max(axis=0)
    confidence = 1.0 / np.exp(scores - largest).sum(axis=0)
    return scores.argmax(axis=0).astype(np.uint8), confidence.astype(np.float32)


def summarise_corridors(
    mask: U8, confidence: F32, corridors: CorridorConfig, visible_frac: F32 | None = None
) -> CorridorEvidence:
    """Non-water fraction, uncertainty and clear width of each corridor; cells on its border count in part (E4-E6).

    visible_frac: visible fraction of each cell (own hull and what lies outside the picture are not visible); None: all
    is visible. A corridor of which less than `MIN_VISIBLE_FRAC` is visible is blocked.
    """
    rows = overlap_fractions(mask.shape[0], corridors.top, 1.0)
    visible = (np.ones(mask.shape, np.float32) if visible_frac is None else visible_frac).astype(np.float64)
    water = (mask == WATER) * visible
    is_way = None
    if corridors.open_water:
        is_way = measure_open_depth(mask, visible.astype(np.float32)) >= corridors.min_depth
    return CorridorEvidence(
        *(
            _summarise_corridor(
                water,
                confidence * visible,
                visible,
                rows,
                overlap_fractions(mask.shape[1], *span),
                corridors.clear_column,
                is_way,
            )
            for span in (corridors.left, corridors.center, corridors.right)
        )
    )


def find_water_edge(mask: U8, visible_frac: F32) -> tuple[float, ...]:
    """For each column, where the water that begins at the picture's bottom ends: `Evidence.water_edge`.

    mask: uint8 [h, w], as the picture is, not levelled. visible_frac: fraction of each cell that is not own hull.
    A column of nothing but own hull has no water. Specks count as water: see `SPECK_MAX_CELLS`.
    """
    height = mask.shape[0]
    hull = visible_frac < MIN_VISIBLE_FRAC
    is_end = _remove_specks((mask != WATER) & ~hull)
    lowest = height - is_end[::-1].argmax(axis=0)  # its lower edge, in cells from the top
    edge = np.where(is_end.any(axis=0), lowest, np.where(hull.all(axis=0), height, 0))
    return tuple((edge / height).tolist())


def measure_open_depth(mask: U8, visible_frac: F32) -> NDArray[np.float64]:
    """For each column, how far the water connected with the bow goes without a break, of the picture's height: [w].

    Connected with the bow is the water that meets the lowest `BOW_ROWS_FRAC` of the picture. What lies below its lowest
    cell there is the boat's own bow, or floats before it. Specks count as water.
    """
    height = mask.shape[0]
    hull = visible_frac < MIN_VISIBLE_FRAC
    is_water = ~_remove_specks((mask != WATER) & ~hull) & ~hull
    _, region_of = cv2.connectedComponents(is_water.astype(np.uint8), connectivity=4)
    start = height - max(1, round(BOW_ROWS_FRAC * height))
    at_bow = np.unique(region_of[start:][is_water[start:]])
    connected = np.isin(region_of, at_bow) & is_water
    from_below = connected[::-1]
    first = from_below.argmax(axis=0)
    rows = np.arange(height)[:, None]
    is_break = ~from_below & (rows > first)
    end = np.where(is_break.any(axis=0), is_break.argmax(axis=0), height)
    is_met = from_below[: height - start].any(axis=0)
    return np.asarray(np.where(is_met, (end - first) / height, 0.0), np.float64)


def _remove_specks(is_end: NDArray[np.bool_]) -> NDArray[np.bool_]:
    count, region_of, box, _ = cv2.connectedComponentsWithStats(is_end.astype(np.uint8), connectivity=8)
    is_speck = (box[:, cv2.CC_STAT_AREA] <= SPECK_MAX_CELLS) & (
        box[:, cv2.CC_STAT_TOP] >= SPECK_MIN_TOP_FRAC * is_end.shape[0]
    )
    return is_end & ~is_speck[region_of] if count > 1 else is_end


def overlap_fractions(cells: int, start: float, end: float) -> NDArray[np.float64]:
    """Fraction of each of `cells` equal parts of [0, 1] that lies in [start, end]: [cells] in [0, 1]."""
    edges = np.arange(cells + 1) / cells
    inside = np.minimum(edges[1:], end) - np.maximum(edges[:-1], start)
    return np.asarray(np.clip(inside, 0.0, None) * cells, np.float64)


def _summarise_corridor(
    water: NDArray[np.float64],
    confidence: NDArray[np.float64],
    visible: NDArray[np.float64],
    rows: NDArray[np.float64],
    columns: NDArray[np.float64],
    clear_column: float,
    is_way: NDArray[np.bool_] | None,
) -> LaneEvidence:
    visible_of_column = rows @ visible
    total = float(visible_of_column @ columns)
    if total < MIN_VISIBLE_FRAC * rows.sum() * columns.sum():
        return LaneEvidence()
    water_of_column = rows @ water
    non_water = 1.0 - float(water_of_column @ columns) / total  # E4
    uncertainty = 1.0 - float(rows @ confidence @ columns) / total  # E5
    clear = (visible_of_column > 0.0) & (water_of_column >= (clear_column - 1e-12) * visible_of_column)
    return LaneEvidence(
        non_water=min(1.0, max(0.0, non_water)),
        uncertainty=min(1.0, max(0.0, uncertainty)),
        clear_width=_widest_run(clear, columns),  # E6
        open_width=msgspec.UNSET if is_way is None else _widest_run(is_way, columns),
    )


def _widest_run(is_clear: NDArray[np.bool_], columns: NDArray[np.float64]) -> float:
    """The widest run of clear columns, as a fraction of the corridor's width."""
    longest = run = 0.0
    for clear, width in zip(is_clear.tolist(), columns.tolist(), strict=True):
        run = run + width if width > 0.0 and clear else 0.0
        longest = max(longest, run)
    return min(1.0, longest / float(columns.sum()))
