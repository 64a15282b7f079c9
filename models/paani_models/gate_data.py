"""Pictures for the gate: clean ones to accept, spoilt ones labelled by what the fault does to the segmenter."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterable, Sequence

import cv2
import msgspec
import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from paani.picture_faults import FAULTS, MOVES, SEVERITIES, above_water, spoilt
from paani_models.augment import land_crop
from paani_models.gate import INPUT_HEIGHT_PX, INPUT_WIDTH_PX
from paani_models.segmenter_metrics import class_iou, confusion
from paani_models.sources import Sample, read_pair, read_picture

Bytes = NDArray[np.uint8]
MIDDLE_WH = (320, 240)
DRY_VIEWS = 3  # tries for each scene, beside the view of all that is above its water
MUST_REJECT, MUST_ACCEPT = 0.60, 0.75  # mIoU of a cell below and above which the verdict is settled


class Cell(msgspec.Struct, frozen=True):
    """One fault in one severity: the segmenter's mIoU on it over n pictures."""

    fault: str
    severity: int
    miou: float
    n: int

    @property
    def fit(self) -> bool | None:
        """Must it be accepted? None where either verdict will do."""
        return False if self.miou < MUST_REJECT else True if self.miou > MUST_ACCEPT else None


class Scene(msgspec.Struct, frozen=True):
    """BGR uint8 [240,320,3] and classes uint8 [240,320]."""

    picture: Bytes
    mask: Bytes


def scene(sample: Sample) -> Scene:
    """A segmented sample at the gate's size. Raises UserError naming an unreadable file."""
    rgb, mask = read_pair(sample)
    return Scene(middle(rgb), np.asarray(cv2.resize(mask, MIDDLE_WH, interpolation=cv2.INTER_NEAREST), np.uint8))


def middle(rgb: Bytes) -> Bytes:
    """BGR uint8 [240,320,3] of an RGB picture."""
    return np.asarray(cv2.resize(rgb, MIDDLE_WH, interpolation=cv2.INTER_AREA)[:, :, ::-1], np.uint8)


def net_input(bgr: Bytes) -> Bytes:
    """BGR uint8 [240,320,3] -> RGB uint8 [3,120,160]."""
    small = cv2.resize(bgr, (INPUT_WIDTH_PX, INPUT_HEIGHT_PX), interpolation=cv2.INTER_AREA)
    return np.ascontiguousarray(small[:, :, ::-1].transpose(2, 0, 1))


def cells(scenes: Sequence[Scene], segment: Callable[[Bytes], Bytes]) -> list[Cell]:
    """The segmenter's error on every fault and severity.

    segment: BGR uint8 [240,320,3] -> classes uint8 [240,320].
    """
    found = []
    for name in tqdm((*FAULTS, *MOVES), desc="faults", unit="fault"):
        for severity in SEVERITIES:
            total = np.zeros((3, 3), np.int64)
            for index, one in enumerate(scenes):
                picture, mask = spoilt(name, one.picture, one.mask, severity, _rng(name, severity, index))
                total += confusion(segment(picture), mask, 3)
            found.append(Cell(name, severity, float(np.nanmean(class_iou(total))), len(scenes)))
    return found


def examples(
    scenes: Sequence[Scene], clean: Iterable[Bytes], settled: Sequence[Cell], per_scene: int
) -> tuple[Bytes, NDArray[np.float32]]:
    """Net inputs uint8 [N,3,120,160] and what they should say, float32 [N]: 1 fit, 0 not.

    clean: BGR uint8 [240,320,3], all fit. Of the settled cells, `per_scene` are drawn for each scene; views without
    water come with it.
    """
    inputs, fits = [], []

    def add(bgr: Bytes, fit: bool) -> None:
        inputs.append(net_input(bgr))
        fits.append(float(fit))

    for bgr in clean:
        add(bgr, True)
    known = [cell for cell in settled if cell.fit is not None]
    for index, one in enumerate(tqdm(scenes, desc="pictures", unit="scene")):
        rng = _rng("draw", 0, index)
        for chosen in rng.choice(len(known), min(per_scene, len(known)), replace=False):
            cell = known[int(chosen)]
            picture, _ = spoilt(cell.fault, one.picture, one.mask, cell.severity, rng)
            add(picture, bool(cell.fit))
        add(one.picture, True)
        dry = above_water(one.picture, one.mask)
        if dry is not None:
            add(dry, False)
        for _ in range(DRY_VIEWS):
            part = land_crop(rng, one.picture, one.mask)
            if part is not None:
                add(np.asarray(cv2.resize(part[0], MIDDLE_WH, interpolation=cv2.INTER_LINEAR), np.uint8), False)
    return np.stack(inputs), np.array(fits, np.float32)


def clean_picture(sample: Sample) -> Bytes:
    """A sample's picture as it is. Raises UserError naming an unreadable file."""
    return middle(read_picture(sample.picture))


def _rng(name: str, severity: int, index: int) -> np.random.Generator:
    return np.random.default_rng([zlib.crc32(name.encode()), severity, index])
