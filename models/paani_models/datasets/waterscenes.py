"""Prepare WaterScenes (Yao et al. 2023) from its official layout: pictures and boxes of four classes (R1 - R8).

    ROOT/image/000001.jpg
    ROOT/detection/yolo/000001.txt      class cx cy width height
    ROOT/train.txt, val.txt, test.txt   one id or file name per line

Radar, navigation and segmentation folders are not read.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path, PurePosixPath

import numpy as np
from tqdm import tqdm

from paani.errors import UserError
from paani.whole_file import new_folder
from paani_models.datasets.checked_files import Box, raise_first_mistake, read_yolo
from paani_models.datasets.intake import Intake
from paani_models.datasets.leaks import Leak
from paani_models.datasets.manifest import SPLITS, SourceManifest, Split
from paani_models.datasets.sources import DETECTOR_CLASSES

PIER, BUOY, SAILOR, SHIP, BOAT, VESSEL, KAYAK = range(7)
SEED = 42  # R2
TRAIN_IMAGES = 10_000  # R1
RARE = frozenset({BUOY, SAILOR, KAYAK})  # R2
OUR_CLASS = {
    SAILOR: "person",
    SHIP: "vessel",
    BOAT: "vessel",
    VESSEL: "vessel",
    KAYAK: "vessel",
    PIER: "pier",
    BUOY: "buoy",
}  # R4
TERMS = SourceManifest(
    source="waterscenes",
    repo="WaterScenes/WaterScenes",
    commit="",
    licence="CC BY-NC-SA 4.0 (readme of the repository): non-commercial research",
    provenance="official lists; of the training list, pictures with buoy, sailor or kayak first, then others at random",
    mask="none",
    annotated=DETECTOR_CLASSES,
)


def read_lists(root: Path) -> dict[Split, tuple[str, ...]]:
    """Ids per split, in the official order.

    Raises UserError naming a list that is missing or empty, an id named twice, or one in two splits (R8).
    """
    lists: dict[Split, tuple[str, ...]] = {}
    owner: dict[str, Split] = {}
    for split in SPLITS:
        path = root / f"{split}.txt"
        try:
            lines = path.read_text(encoding="utf-8").splitlines()
        except (OSError, UnicodeDecodeError) as error:
            raise UserError(f"{path}: {error}") from error
        lists[split] = tuple(PurePosixPath(line.strip()).stem for line in lines if line.strip())
        if not lists[split]:
            raise UserError(f"{path}: names no picture")
        for identity in lists[split]:
            if identity in owner:
                where = "twice" if owner[identity] == split else f"and so does {owner[identity]}.txt"
                raise UserError(f"{path}: names {identity} {where}")
            owner[identity] = split
    return lists


def select_train(boxes: Mapping[str, Sequence[Box]], limit: int = TRAIN_IMAGES, seed: int = SEED) -> tuple[str, ...]:
    """Choose `limit` ids: first those that show a buoy, sailor or kayak, then others at random (R2).

    boxes: by id, in WaterScenes classes. Sorted; the same for the same ids and seed, whatever their order.
    """
    rng = np.random.default_rng(seed)
    rare = sorted(identity for identity, seen in boxes.items() if RARE & {box.kind for box in seen})
    rest = sorted(set(boxes) - set(rare))
    chosen: list[str] = []
    for group in (rare, rest):
        free = min(limit - len(chosen), len(group))
        chosen += [group[index] for index in rng.permutation(len(group))[:free]]
    return tuple(sorted(chosen))


def map_classes(boxes: Sequence[Box]) -> tuple[Box, ...]:
    """WaterScenes classes -> ours; every box is kept (R3, R4)."""
    return tuple(Box(DETECTOR_CLASSES.index(OUR_CLASS[b.kind]), b.cx, b.cy, b.width, b.height) for b in boxes)


def prepare_waterscenes(
    root: Path,
    out: Path,
    *,
    train_images: int = TRAIN_IMAGES,
    seed: int = SEED,
    missing_is_empty: bool = False,
    strict: bool = False,
) -> tuple[SourceManifest, list[Leak]]:
    """Write the new folder `out`: images/, labels/ and manifest.json; return the manifest and the leaks let pass.

    strict: refuse splits that share bytes or all but the same view. The official lists do not promise that they do
    not, so otherwise such pairs are only reported. missing_is_empty: a picture without a label file shows no object.
    Raises UserError, leaving nothing behind, for whatever `read_lists` refuses, a folder or file that is missing, a
    picture that cannot be read, and a bad box: the first by name, the others counted.
    """
    lists = read_lists(root)
    images, labels = root / "image", root / "detection" / "yolo"
    for folder in (images, labels):
        if not folder.is_dir():
            raise UserError(f"{folder}: no such folder")
    boxes: dict[str, tuple[Box, ...]] = {}
    mistakes: list[str] = []
    for identity in tqdm(sorted(i for ids in lists.values() for i in ids), "boxes", unit="file", mininterval=2.0):
        label = labels / f"{identity}.txt"
        try:
            empty = missing_is_empty and not label.exists()
            boxes[identity] = () if empty else read_yolo(label, len(OUR_CLASS))
        except UserError as error:
            mistakes.append(str(error))
    for label in sorted(labels.glob("*.txt")):
        if not (images / f"{label.stem}.jpg").exists():
            mistakes.append(f"{label}: has no picture {label.stem}.jpg")
    raise_first_mistake(mistakes)
    chosen = dict(lists)
    chosen["train"] = select_train({identity: boxes[identity] for identity in lists["train"]}, train_images, seed)
    with new_folder(out) as beside:
        intake = Intake(beside, TERMS.source)
        places = [(split, identity) for split in SPLITS for identity in chosen[split]]
        for split, identity in tqdm(places, "pictures", unit="picture", mininterval=2.0):
            intake.add(images / f"{identity}.jpg", split=split, boxes=map_classes(boxes[identity]))
        return intake.write_manifest(TERMS, strict=strict)
