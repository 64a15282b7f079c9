"""Score the exported segmenter on annotated pictures: counts per picture, from which every figure is summed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from paani.arrays import F32, I64, U8
from paani.cluster import Workers
from paani.errors import UserError
from paani_models.catalogue import read_contract
from paani_models.datasets.batches import Batch, network_of, score_batches
from paani_models.datasets.sources import SEGMENTER_CLASSES, WATER_MASKS, Sample, Source, read_mask, read_picture
from paani_models.engines.onnx_runner import open_network
from paani_models.segmenter.metrics import class_iou, confusion_matrix, count_edge_matches, f1_score

WATER, OBSTACLE, SKY = (SEGMENTER_CLASSES.index(kind) for kind in ("water", "obstacle", "sky"))


@dataclass(frozen=True)
class ScoredMask:
    """One picture: confusion counts int64 [3,3], rows truth; edge counts int64 [4] of `count_edge_matches`."""

    sample: Sample
    counts: I64
    edges: I64

    @property
    def mean_iou(self) -> float:
        """Mean IoU over what is scored and occurs; 1 where nothing does."""
        iou = class_iou(self.counts)[[SEGMENTER_CLASSES.index(kind) for kind in scored_classes(self.sample.source)]]
        return float(np.nanmean(iou)) if np.isfinite(iou).any() else 1.0


def score_masks(net: Path, samples: Sequence[Sample], workers: Workers | None = None) -> list[ScoredMask]:
    """Run the network over samples with masks. workers: who does; this process if not given.

    Raises UserError naming a file that cannot be read.
    """
    return score_batches(score_mask_batch, net, samples, workers, "segmenter")


def score_mask_batch(batch: Batch) -> list[ScoredMask]:
    """As `score_masks`, of one batch."""
    segment = open_segmenter(network_of(batch))
    scored = []
    for sample in batch.samples:
        truth = read_truth(sample)
        label = merge_undrawn_sky(segment(read_picture(sample.picture), truth.shape), sample.source)
        counts = confusion_matrix(label, truth, len(SEGMENTER_CLASSES))
        scored.append(ScoredMask(sample, counts, np.array(count_edge_matches(label, truth), np.int64)))
    return scored


def open_segmenter(net: Path) -> Callable[[NDArray[np.uint8], tuple[int, ...]], U8]:
    """Open a segmenter as a function from an RGB picture and a shape (H, W, ...) to classes uint8 [H,W]."""
    logits_of = open_logits(net)
    return lambda picture, shape: label_from_logits(logits_of(picture), shape)


def open_logits(net: Path) -> Callable[[NDArray[np.uint8]], F32]:
    """Open a segmenter as a function from an RGB picture to logits [1,3,h,w] in the order of SEGMENTER_CLASSES.

    Size, preprocessing and order of classes are those of the network's contract.
    """
    run, contract = open_network(net), read_contract(net, "segmenter")
    size_wh = contract.input.shape[:1:-1]
    mean, std = (np.array(v, np.float32) for v in (contract.preprocessing.mean, contract.preprocessing.std))
    rows = [contract.classes.index(name) for name in SEGMENTER_CLASSES]

    def logits_of(picture: NDArray[np.uint8]) -> F32:
        scaled = (cv2.resize(picture, size_wh).astype(np.float32) / 255.0 - mean) / std
        return run(np.ascontiguousarray(scaled.transpose(2, 0, 1)[None]))[:, rows]

    return logits_of


def label_from_logits(logits: F32, shape: tuple[int, ...]) -> U8:
    """Logits [1,3,h,w] -> the best class, nearest pixel, uint8 [H,W]."""
    label = logits[0].argmax(0).astype(np.uint8)
    return np.asarray(cv2.resize(label, (shape[1], shape[0]), interpolation=cv2.INTER_NEAREST), np.uint8)


def read_truth(sample: Sample) -> U8:
    """Read the mask that people drew, in segmenter classes; where they drew only water, the rest is obstacle."""
    if sample.mask is None:
        raise UserError(f"{sample.picture}: has no mask")
    drawn = sample.mask.parent.parent / WATER_MASKS / sample.mask.name if sample.source.water_only else sample.mask
    return read_mask(drawn)


def merge_undrawn_sky(label: U8, source: Source) -> U8:
    """Count sky as obstacle in sources whose masks distinguish only water."""
    return np.minimum(label, OBSTACLE) if source.water_only else label


def scored_classes(source: Source) -> tuple[str, ...]:
    """Classes that people drew in a source."""
    return ("water",) if source.water_only else SEGMENTER_CLASSES


def mask_measures(source: Source) -> dict[str, Callable[[I64], float]]:
    """Figures of one source by name, each a function of added counts int64 [13]: confusion, then edges (U3, U4)."""

    def iou(kind: str) -> Callable[[I64], float]:
        return lambda sums: float(class_iou(sums[:9].reshape(3, 3))[SEGMENTER_CLASSES.index(kind)])

    measures = {f"iou_{kind}": iou(kind) for kind in scored_classes(source)}
    if not source.water_only:
        measures["miou"] = lambda sums: float(np.nanmean(class_iou(sums[:9].reshape(3, 3))))
    if not source.soft_edges:
        measures["edge_f1"] = lambda sums: f1_score(*(int(count) for count in sums[9:]))
    return measures


def sum_counts(scored: Sequence[ScoredMask]) -> I64:
    """Counts of many pictures, int64 [13]."""
    rows = [np.concatenate([item.counts.ravel(), item.edges]) for item in scored]
    return np.sum(rows, axis=0, dtype=np.int64) if rows else np.zeros(13, np.int64)
