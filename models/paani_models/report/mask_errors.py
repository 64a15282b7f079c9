"""Error analysis of the segmenter: where its wrong pixels lie, and the best that its output grid allows."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from paani.arrays import I64, U8
from paani_models.datasets.sources import IGNORE, SEGMENTER_CLASSES, Sample, Source, read_picture
from paani_models.segmenter.metrics import boundary_pixels, class_iou, confusion_matrix, count_edge_matches, f1_score
from paani_models.segmenter.scores import WATER, label_from_logits, merge_undrawn_sky, read_truth

EDGE_DISTANCES_PX = (2, 4, 8)
TENTHS = 10
CELLS_HW = (64, 80)  # the shipped segmenter scores cells of 4x4 pixels of its 256x320 input, and interpolates
_UNDECIDED = len(SEGMENTER_CLASSES)


@dataclass(frozen=True)
class MaskErrors:
    """Sums over the pictures of one source, in pixels of its masks.

    counts, edges: as `confusion_matrix` and `count_edge_matches` give them, an undecided band between two classes split
    along its middle for the edges; best_counts, best_edges: those of the best answer on CELLS_HW. near: wrong pixels
    within EDGE_DISTANCES_PX of a true edge or undecided band. false_water, missed_water, judged: by tenth of the
    height, top first.
    """

    source: Source
    n: int
    counts: I64
    edges: I64
    best_counts: I64
    best_edges: I64
    near: I64
    false_water: I64
    missed_water: I64
    judged: I64

    @property
    def wrong(self) -> int:
        """Judged pixels of another class than the truth."""
        return int(self.counts.sum() - np.trace(self.counts))


def analyse_mask_errors(
    samples: Sequence[Sample], segment: Callable[[NDArray[np.uint8], tuple[int, ...]], U8]
) -> list[MaskErrors]:
    """Analyse each source. Raises UserError naming a file that cannot be read."""
    found: dict[Source, list[I64]] = {}
    for sample in tqdm(samples, "mistakes", unit="picture", mininterval=2.0):
        truth = read_truth(sample)
        label = merge_undrawn_sky(segment(read_picture(sample.picture), truth.shape), sample.source)
        row = np.concatenate([part.ravel() for part in count_mask_errors(label, truth)])
        found.setdefault(sample.source, []).append(row)
    parts = np.cumsum([9, 4, 9, 4, len(EDGE_DISTANCES_PX), TENTHS, TENTHS])
    limits = []
    for source, rows in found.items():
        counts, edges, best_counts, best_edges, *rest = np.split(np.sum(rows, axis=0), parts)
        square = counts.reshape(3, 3), edges, best_counts.reshape(3, 3), best_edges
        limits.append(MaskErrors(source, len(rows), *square, *rest))
    return limits


def count_mask_errors(label: U8, truth: U8) -> tuple[I64, ...]:
    """The counts of one picture, in the order of MaskErrors."""
    decided = fill_undecided(truth)
    best = round_to_cells(decided)
    wrong = (label != truth) & (truth != IGNORE)
    edge = boundary_pixels(np.where(truth == IGNORE, np.uint8(_UNDECIDED), truth))
    distance_px = cv2.distanceTransform((~edge).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    classes = len(SEGMENTER_CLASSES)
    return (
        confusion_matrix(label, truth, classes),
        np.array(count_edge_matches(label, decided), np.int64),
        confusion_matrix(best, truth, classes),
        np.array(count_edge_matches(best, decided), np.int64),
        np.array([(wrong & (distance_px <= reach)).sum() for reach in EDGE_DISTANCES_PX], np.int64),
        count_by_tenth(wrong & (label == WATER)),
        count_by_tenth(wrong & (truth == WATER)),
        count_by_tenth(truth != IGNORE),
    )


def fill_undecided(truth: U8) -> U8:
    """Give undecided pixels the class of the nearest decided one; a mask without any stays as it is."""
    undecided = truth == IGNORE
    if undecided.all() or not undecided.any():
        return truth
    _, nearest = cv2.distanceTransformWithLabels(
        undecided.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )
    kinds = np.zeros(int(nearest.max()) + 1, np.uint8)
    kinds[nearest[~undecided]] = truth[~undecided]
    return np.asarray(kinds[nearest], np.uint8)


def round_to_cells(truth: U8) -> U8:
    """Give each cell of CELLS_HW the class that fills most of it: the best possible output on that grid."""
    size_wh = CELLS_HW[::-1]
    shares = [
        cv2.resize((truth == kind).astype(np.float32), size_wh, interpolation=cv2.INTER_AREA)
        for kind in range(len(SEGMENTER_CLASSES))
    ]
    return label_from_logits(np.stack(shares)[None], truth.shape)


def count_by_tenth(flags: NDArray[np.bool_]) -> I64:
    """Count set pixels per tenth of the height, int64 [10], top first."""
    return np.array([part.sum() for part in np.array_split(flags, TENTHS)], np.int64)


def water_iou(counts: I64) -> float:
    """IoU of water from a confusion matrix [3,3]."""
    return float(class_iou(counts)[WATER])


def mean_iou(counts: I64) -> float:
    """Mean over the classes that occur."""
    return float(np.nanmean(class_iou(counts)))


def edge_f1(edges: I64) -> float:
    """F1 of counts as `count_edge_matches` gives them."""
    return f1_score(*(int(count) for count in edges))
