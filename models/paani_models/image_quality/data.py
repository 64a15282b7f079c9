"""Pictures for the gate: scenes to spoil, and what each fault does to the segmenter on them."""

from __future__ import annotations

import zlib
from collections import Counter
from collections.abc import Callable, Sequence

import cv2
import msgspec
import numpy as np
from tqdm import tqdm

from paani.arrays import U8
from paani.picture_faults import FAULTS, MOVES, MUST_ACCEPT, MUST_REJECT, SEVERITIES, WATER, spoilt
from paani_models.datasets.sources import RENDERED, Sample, read_mask, read_picture
from paani_models.segmenter.metrics import class_iou, confusion_matrix
from paani_models.training.augment import OBSTACLE

Segment = Callable[[U8], U8]  # BGR uint8 [240,320,3] -> classes uint8 [240,320]
MIDDLE_WH = (320, 240)
TRAINING_MIOU_BIAS = 0.05  # the segmenter was trained on these pictures: on others its mIoU is lower
PREDICTED_WATER_MARGIN_PX = 9  # around water that the segmenter found, what is above it may be water too
# Whole sequences are not trained on and choose the threshold: of each source this share, and never more than so much.
VALIDATION_FRAC, MAX_VALIDATION_FRAC = 0.1, 0.2


class FaultLevel(msgspec.Struct, frozen=True):
    """One fault in one severity: the segmenter's mIoU on it over n pictures."""

    fault: str
    severity: int
    miou: float
    n: int

    @property
    def target(self) -> float:
        """What the net should say: 0 and 1 where the verdict is settled, and in between what lies in between."""
        return float(np.clip((self.miou - TRAINING_MIOU_BIAS - MUST_REJECT) / (MUST_ACCEPT - MUST_REJECT), 0.0, 1.0))


class Scene(msgspec.Struct, frozen=True):
    """A picture that is fit as it is, or dry: without water, never fit.

    picture: BGR uint8 [240,320,3]. mask: classes uint8 [240,320]. drawn: the classes are people's. checked: it is not
    trained on.
    """

    picture: U8
    mask: U8
    drawn: bool
    validation: bool
    without_water: bool = False


def read_scenes(samples: Sequence[Sample], segment: Segment) -> list[Scene]:
    """Samples at the gate's size, without rendered ones on which the segmenter fails.

    What nobody segmented has the segmenter's own mask. Raises UserError naming an unreadable file.
    """
    found = []
    held_back = choose_validation_sequences(samples)
    for sample in tqdm(samples, desc="reading", unit="picture"):
        picture = resize_bgr(read_picture(sample.picture))
        rendered = sample.source.name == RENDERED
        if sample.without_water:
            mask = np.full(picture.shape[:2], OBSTACLE, np.uint8)
        elif sample.mask is None:
            mask = _widen_predicted_water(segment(picture))
        else:
            mask = np.asarray(cv2.resize(read_mask(sample.mask), MIDDLE_WH, interpolation=cv2.INTER_NEAREST), np.uint8)
            if rendered and mean_iou(segment(picture), mask) <= MUST_ACCEPT:
                continue
        checked = (sample.source.name, sample.sequence) in held_back
        drawn = sample.mask is not None and not rendered
        found.append(Scene(picture, mask, drawn, checked, sample.without_water))
    return found


def choose_validation_sequences(samples: Sequence[Sample]) -> set[tuple[str, str]]:
    """Source and name of the sequences that are not trained on; none of a source whose sequences are all too long."""
    lengths = Counter((sample.source.name, sample.sequence) for sample in samples)
    totals = Counter(sample.source.name for sample in samples)
    taken: Counter[str] = Counter()
    chosen = set()
    for source, sequence in sorted(lengths, key=lambda pair: zlib.crc32("gate {} {}".format(*pair).encode())):
        grown = taken[source] + lengths[source, sequence]
        if taken[source] < VALIDATION_FRAC * totals[source] and grown <= MAX_VALIDATION_FRAC * totals[source]:
            taken[source] = grown
            chosen.add((source, sequence))
    return chosen


def resize_bgr(rgb: U8) -> U8:
    """BGR uint8 [240,320,3] of an RGB picture."""
    return np.asarray(cv2.resize(rgb, MIDDLE_WH, interpolation=cv2.INTER_AREA)[:, :, ::-1], np.uint8)


def mean_iou(predicted: U8, truth: U8) -> float:
    """Mean over the classes that occur."""
    return float(np.nanmean(class_iou(confusion_matrix(predicted, truth, 3))))


def measure_fault_levels(chosen: Sequence[Scene], segment: Segment) -> list[FaultLevel]:
    """The segmenter's error on every fault and severity."""
    found = []
    for name in tqdm((*FAULTS, *MOVES), desc="faults", unit="fault"):
        for severity in SEVERITIES:
            total = np.zeros((3, 3), np.int64)
            for index, one in enumerate(chosen):
                rng = np.random.default_rng([zlib.crc32(name.encode()), severity, index])
                picture, mask = spoilt(name, one.picture, one.mask, severity, rng)
                total += confusion_matrix(segment(picture), mask, 3)
            found.append(FaultLevel(name, severity, float(np.nanmean(class_iou(total))), len(chosen)))
    return found


def _widen_predicted_water(guessed: U8) -> U8:
    """The segmenter's classes, its water made larger; all of it water where there is little, so that nothing is dry."""
    water = (guessed == WATER).astype(np.uint8)
    if water.mean() < 0.1:
        return np.full_like(guessed, WATER)
    near = cv2.dilate(water, np.ones((PREDICTED_WATER_MARGIN_PX, PREDICTED_WATER_MARGIN_PX), np.uint8))
    return np.asarray(np.where(near > 0, WATER, guessed), np.uint8)
