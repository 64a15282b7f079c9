"""Measure the image-quality check's verdict and the segmenter's error on each fault and severity."""

import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence

import cv2
import msgspec
import numpy as np
from numpy.typing import NDArray

from paani.arrays import U8
from paani.messages import UnusableCause
from paani.picture_faults import (
    FAULTS,
    GEOMETRIC_FAULTS,
    NO_WATER,
    SEVERITIES,
    apply_fault,
    crop_above_water,
    required_verdict,
)
from paani_tools.faults.corpus import Scene

Segment = Callable[[U8], U8]
Judge = Callable[[U8], UnusableCause]


class LevelFigures(msgspec.Struct, frozen=True):
    """One fault in one severity over n pictures.

    `miou`: of the segmenter, against what the spoilt picture shows.
    """

    fault: str
    severity: int
    n: int
    miou: float
    rejected: int

    @property
    def verdict(self) -> str:
        """What the image-quality check must do here: "reject", "accept", or "free"."""
        return required_verdict(self.fault, self.miou)


class CleanFigures(msgspec.Struct, frozen=True):
    """Pictures of one source as they are, and how many of them the image-quality check refused, by cause."""

    source: str
    n: int
    rejected: int
    causes: tuple[str, ...] = ()


class Totals(msgspec.Struct, frozen=True):
    """Shares over all cells whose verdict is settled, and over clean pictures."""

    false_accept_frac: float
    false_reject_frac: float
    clean_reject_frac: float


def measure_levels(scenes: Sequence[Scene], segment: Segment, judge: Judge) -> Iterator[LevelFigures]:
    """Measure every fault level in turn; the last row is views without water.

    segment: BGR uint8 [H, W, 3] to classes uint8 [h, w]. judge: one picture, as the first of a new camera.
    """
    for name in (*FAULTS, *GEOMETRIC_FAULTS):
        for severity in SEVERITIES:
            counts, rejected = np.zeros((3, 3), np.int64), 0
            for index, scene in enumerate(scenes):
                rng = np.random.default_rng([zlib.crc32(name.encode()), severity, index])
                picture, mask = apply_fault(name, scene.picture, scene.mask, severity, rng)
                counts += count_classes(segment(picture), mask)
                rejected += judge(picture) is not UnusableCause.NONE
            yield LevelFigures(name, severity, len(scenes), mean_iou(counts), rejected)
    dry = [view for scene in scenes if (view := crop_above_water(scene.picture, scene.mask)) is not None]
    yield LevelFigures(NO_WATER, 5, len(dry), 0.0, sum(judge(view) is not UnusableCause.NONE for view in dry))


def measure_clean(source: str, pictures: Iterable[U8], judge: Judge) -> CleanFigures:
    """Measure pictures without a fault."""
    causes = [judge(picture) for picture in pictures]
    refused = sorted(str(cause) for cause in causes if cause is not UnusableCause.NONE)
    return CleanFigures(source, len(causes), len(refused), tuple(dict.fromkeys(refused)))


def sum_up(cells: Sequence[LevelFigures], clean: Sequence[CleanFigures]) -> Totals:
    """Compute the three shares that are required of the image-quality check."""

    def share(wrong: int, n: int) -> float:
        return wrong / n if n else 0.0

    rejecting = [cell for cell in cells if cell.verdict == "reject"]
    accepting = [cell for cell in cells if cell.verdict == "accept"]
    return Totals(
        share(sum(cell.n - cell.rejected for cell in rejecting), sum(cell.n for cell in rejecting)),
        share(sum(cell.rejected for cell in accepting), sum(cell.n for cell in accepting)),
        share(sum(source.rejected for source in clean), sum(source.n for source in clean)),
    )


def count_classes(predicted: U8, truth: U8) -> NDArray[np.int64]:
    """Counts [3, 3], rows truth, columns prediction, where the truth is known; the truth is taken to its grid."""
    truth = np.asarray(cv2.resize(truth, predicted.shape[::-1], interpolation=cv2.INTER_NEAREST), np.uint8)
    known = truth < 3
    pairs = truth[known].astype(np.int64) * 3 + predicted[known]
    return np.bincount(pairs, minlength=9).reshape(3, 3)


def mean_iou(counts: NDArray[np.int64]) -> float:
    """Mean of the classes that occur (U3)."""
    hits = np.diag(counts).astype(np.float64)
    union = counts.sum(0) + counts.sum(1) - np.diag(counts)
    return float((hits[union > 0] / union[union > 0]).mean()) if union.any() else 0.0
