"""Training pictures of the image-quality network, and the segmenter's error on each fault, which is its target.

The target of a corrupted picture is not labelled by hand: the segmenter's mean IoU on every fault and severity is
measured, and mapped linearly from MUST_REJECT..MUST_ACCEPT to 0..1.
"""

from __future__ import annotations

import zlib
from collections import Counter
from collections.abc import Callable, Sequence

import cv2
import msgspec
import numpy as np
from tqdm import tqdm

from paani.arrays import U8
from paani.picture_faults import FAULTS, GEOMETRIC_FAULTS, MUST_ACCEPT, MUST_REJECT, SEVERITIES, WATER, apply_fault
from paani_models.datasets.sources import RENDERED, Sample, read_mask, read_picture
from paani_models.segmenter.metrics import class_iou, confusion_matrix
from paani_models.training.augment import OBSTACLE

Segment = Callable[[U8], U8]  # BGR uint8 [240,320,3] -> classes uint8 [240,320]
MIDDLE_WH = (320, 240)
TRAINING_MIOU_BIAS = (
    0.05  # mIoU by which the segmenter scores better on these pictures, which trained it, than on others
)
PREDICTED_WATER_MARGIN_PX = 9  # side of the square by which predicted water grows, as its edge is uncertain
# Share of each source's pictures whose sequences are kept for validation, and the most that it may become.
VALIDATION_FRAC, MAX_VALIDATION_FRAC = 0.1, 0.2


class FaultLevel(msgspec.Struct, frozen=True):
    """One fault at one severity, and the mean IoU that the segmenter reaches on it over n pictures."""

    fault: str
    severity: int
    miou: float
    n: int

    @property
    def target(self) -> float:
        """Fitness that the network should estimate: 0 below MUST_REJECT, 1 above MUST_ACCEPT, linear in between."""
        return float(np.clip((self.miou - TRAINING_MIOU_BIAS - MUST_REJECT) / (MUST_ACCEPT - MUST_REJECT), 0.0, 1.0))


class Scene(msgspec.Struct, frozen=True):
    """A picture that is fit as it is; or, without water, never fit.

    picture: BGR uint8 [240,320,3]. mask: classes uint8 [240,320]. is_hand_drawn: people drew the mask. is_validation:
    it chooses the threshold and is not trained on.
    """

    picture: U8
    mask: U8
    is_hand_drawn: bool
    is_validation: bool
    is_without_water: bool = False


def read_scenes(samples: Sequence[Sample], segment: Segment) -> list[Scene]:
    """Read samples at 320x240. Rendered pictures on which the segmenter fails are left out.

    A picture that nobody segmented gets the segmenter's own mask. Raises UserError naming an unreadable file.
    """
    scenes = []
    validation_sequences = choose_validation_sequences(samples)
    for sample in tqdm(samples, desc="reading", unit="picture"):
        picture = resize_bgr(read_picture(sample.picture))
        is_rendered = sample.source.name == RENDERED
        if sample.without_water:
            mask = np.full(picture.shape[:2], OBSTACLE, np.uint8)
        elif sample.mask is None:
            mask = _widen_predicted_water(segment(picture))
        else:
            mask = np.asarray(cv2.resize(read_mask(sample.mask), MIDDLE_WH, interpolation=cv2.INTER_NEAREST), np.uint8)
            if is_rendered and mean_iou(segment(picture), mask) <= MUST_ACCEPT:
                continue
        is_validation = (sample.source.name, sample.sequence) in validation_sequences
        is_hand_drawn = sample.mask is not None and not is_rendered
        scenes.append(Scene(picture, mask, is_hand_drawn, is_validation, sample.without_water))
    return scenes


def choose_validation_sequences(samples: Sequence[Sample]) -> set[tuple[str, str]]:
    """Choose the validation sequences, as (source, name): none of a source whose sequences are all too long."""
    lengths = Counter((sample.source.name, sample.sequence) for sample in samples)
    totals = Counter(sample.source.name for sample in samples)
    taken_counts: Counter[str] = Counter()
    chosen = set()
    for source, sequence in sorted(lengths, key=lambda pair: zlib.crc32("gate {} {}".format(*pair).encode())):
        new_count = taken_counts[source] + lengths[source, sequence]
        if (
            taken_counts[source] < VALIDATION_FRAC * totals[source]
            and new_count <= MAX_VALIDATION_FRAC * totals[source]
        ):
            taken_counts[source] = new_count
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
    for name in tqdm((*FAULTS, *GEOMETRIC_FAULTS), desc="faults", unit="fault"):
        for severity in SEVERITIES:
            total = np.zeros((3, 3), np.int64)
            for index, one in enumerate(chosen):
                rng = np.random.default_rng([zlib.crc32(name.encode()), severity, index])
                picture, mask = apply_fault(name, one.picture, one.mask, severity, rng)
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
