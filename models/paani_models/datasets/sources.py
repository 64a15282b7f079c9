"""The annotated picture sources: what each folder annotates, how its masks are coded, which sequences are held out."""

from __future__ import annotations

import zlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import cv2
import msgspec
import numpy as np
from numpy.typing import NDArray

from paani.errors import UserError
from paani.undecodable import UNREADABLE
from paani_models.datasets.checked_files import read_label_rows

IGNORE = 255
SEGMENTER_CLASSES = ("water", "obstacle", "sky")  # D6
DETECTOR_CLASSES = ("person", "vessel", "pier", "buoy")  # C2
WATER_MASKS = "masks"
ANNOTATIONS = Path(__file__).parents[1] / "annotations"  # <source folder>/<picture>.txt, boxes that we drew
WITHOUT_WATER = ANNOTATIONS / "without_water.txt"  # pictures that show none, a path below the data folder a line
RENDERED = "rendered"  # the one source that is drawn, not photographed

# Coded mask value -> segmenter class (R10): 0 obstacle -> 1, 1 water -> 0, 2 sky -> 2, else ignored.
_MASK_CODES = np.full(256, IGNORE, np.uint8)
_MASK_CODES[:3] = (1, 0, 2)

_RUN_LENGTH = 24  # pictures per run where a source names no sequences


@dataclass(frozen=True)
class Source:
    """One annotated folder.

    masks: subfolder of three-class masks, "" if none. water_only: people marked only water, in WATER_MASKS, and that
    is what is scored. soft_edges: its masks leave a band between classes undecided, so edges are not scored.
    annotated: detector classes whose every instance is boxed; only for those may background be penalised. empty_of:
    classes that its pictures do not show, boxes or none. own_hull: the boat's own bow fills the bottom middle.
    loose_boxes: its boxes say that something is there, not where its edges are: they are no truth for an IoU.
    video: the pictures of a sequence, in the order of the manifest, follow each other closely enough to track things.
    drawn: boxes are in ANNOTATIONS; its sequences pass several places, so ten consecutive frames count as one sequence.
    held_out: sequences for validation; empty means one in `one_in` by name. twins: pictures
    that show what a picture of the other side shows; they are left out. splits: of a prepared public set, which name
    their split in the manifest, the splits that are read; all but "train" are held out.
    """

    name: str
    folder: str
    masks: str = ""
    water_only: bool = False
    soft_edges: bool = False
    labels: str = ""
    annotated: frozenset[str] = frozenset()
    empty_of: frozenset[str] = frozenset()
    own_hull: bool = False
    loose_boxes: bool = False
    video: bool = False
    drawn: bool = False
    held_out: tuple[str, ...] = ()
    one_in: int = 8
    twins: frozenset[str] = frozenset()
    splits: tuple[str, ...] = ()


NO_CRAFT = frozenset({"vessel", "buoy"})

SOURCES = (
    Source(
        "tbiseg_usvinland",
        "tbiseg_usvinland",
        masks="masks3",
        water_only=True,
        empty_of=NO_CRAFT,
        held_out=("H05_8", "N02_4", "N03_4", "W06_2", "X01_2", "X19_03"),
    ),
    Source(
        "tbiseg_tampere",
        "tbiseg_tampere",
        masks="masks3",
        water_only=True,
        own_hull=True,
        held_out=("open_image",),
        twins=frozenset({"open_image_001", "dock_image_068", "dock_image_072"}),
    ),
    Source("tbiseg_dasha", "tbiseg_dasha", masks="masks3", water_only=True, empty_of=NO_CRAFT, held_out=("DJI_0035",)),
    Source("bath_river", "bath_river", masks="masks3", water_only=True, empty_of=NO_CRAFT, held_out=("run3", "run8")),
    Source("mastr1325", "mastr1325_val_recovered", masks="masks", soft_edges=True, held_out=("run2",)),
    Source(
        "oasis",
        "oasis_recovered",
        masks="masks",
        soft_edges=True,
        held_out=("OASIs/type2",),
        twins=frozenset({"OASIs_type2_008", "OASIs_type2_009", "OASIs_type2_010", "OASIs_type2_011"}),
    ),
    Source(
        "mcoe_boats",
        "mcoe_boats",
        labels="labels",
        annotated=frozenset({"vessel", "buoy"}),
        twins=frozenset({"sailing-boat-mastes-rigging-boat-sail-se-983933"}),
    ),
    Source(
        "hsu_shore_tiles",
        "hsu_shore_tiles",
        labels="labels",
        annotated=frozenset({"person", "vessel"}),
        held_out=("519srew5",),
    ),
    Source(
        "hsu_shore_full",
        "hsu_shore_full",
        labels="labels",
        annotated=frozenset({"person", "vessel"}),
        held_out=("519srew5",),
    ),
    Source(
        "uon_robotx",
        "uon_robotx",
        labels="labels",
        annotated=frozenset({"buoy"}),
        held_out=("run6",),
        twins=frozenset({"120L", "121L", "121R", "122L", "123L"}),
    ),
    Source(
        "tunai_sooke",
        "tunai_sooke",
        labels="labels",
        annotated=frozenset({"vessel"}),
        held_out=("2019-07-30", "2019-07-31"),
    ),
    Source("inland_vessel", "inland_vessel", labels="labels", annotated=frozenset({"vessel"})),
    Source("redyellow_buoy", "redyellow_buoy", labels="labels", annotated=frozenset({"buoy"})),
    Source("dasha_pier", "tbiseg_dasha", annotated=frozenset({"pier"}), drawn=True, video=True, held_out=("none",)),
    Source(
        "tampere_pier",
        "tbiseg_tampere",
        annotated=frozenset({"pier"}),
        drawn=True,
        video=True,
        held_out=("dock_image_07", "dock_image_08", "dock_image_09"),  # one place, seen nowhere else
    ),
    Source("lifeguard_swim", "lifeguard_swim", labels="labels", annotated=frozenset({"person"}), one_in=4),
    Source(
        "surf_people",
        "surf_people",
        labels="labels",
        annotated=frozenset({"person"}),
        loose_boxes=True,
        held_out=("block01", "block12"),
    ),
    Source("pennfudan", "pennfudan", labels="labels", annotated=frozenset({"person"}), one_in=4),
    Source("coco_mini", "coco_mini", labels="labels", annotated=frozenset({"person", "vessel"}), one_in=4),
    Source(
        "typesofships_kayak_buoy",
        "typesofships_kayak_buoy",
        labels="labels",
        annotated=frozenset({"vessel", "buoy"}),
        one_in=4,
        twins=frozenset({"45_jpg_32e09e06cc", "194_jpg_cebb25434b", "160_jpg_f5e567bdc8"}),  # of mcoe_boats
    ),
    Source(
        "ships_pd",
        "ships_pd",
        labels="labels",
        annotated=frozenset({"vessel"}),
        one_in=4,
        twins=frozenset({"192_168_0_64_01_20200908141942310_jp_70587625d1"}),
    ),
    Source("boats_valenspace", "boats_valenspace", labels="labels", annotated=frozenset({"vessel"}), one_in=4),
    Source(
        "lake_robotx_buoys",
        "lake_robotx_buoys",
        labels="labels",
        annotated=frozenset({"buoy"}),
        video=True,
        held_out=("block05", "block07"),
        twins=frozenset(
            {
                "buoy_000011_b44f9b9823",
                "buoy_000012_dadadcc173",
                "buoy_000076_7e0e31302d",
                "buoy_000078_9483814f5c",
                "buoy_000081_2fff71642a",
                "buoy_000084_bd6c58138f",
            }
        ),
    ),
    Source(RENDERED, RENDERED, masks="masks", labels="labels", annotated=frozenset(DETECTOR_CLASSES)),
)

LOOSE_SOURCES = frozenset(source.name for source in SOURCES if source.loose_boxes)

_BOXED = Source("waterscenes", "waterscenes", labels="labels", annotated=frozenset(DETECTOR_CLASSES))

# Written by `paani models prepare`, and read only where they are named.
PREPARED_SOURCES = (
    replace(_BOXED, splits=("train", "val")),
    replace(_BOXED, name="waterscenes_test", splits=("test",)),
    Source("mastr1325_official", "mastr1325_official", masks="masks", splits=("train", "val")),
)


@dataclass(frozen=True)
class Sample:
    """One annotated picture; `mask` or `label` is None where the source has none. without_water: it shows none."""

    source: Source
    sequence: str
    held_out: bool
    picture: Path
    mask: Path | None
    label: Path | None
    without_water: bool = False


class _Item(msgspec.Struct):
    file: str
    seq: str = ""
    split: str = ""


class _Manifest(msgspec.Struct):
    items: list[_Item]


def decode_mask_classes(coded: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Mask in file codes, any shape -> segmenter classes water 0, obstacle 1, sky 2, 255 ignored (R10)."""
    return _MASK_CODES[coded]


def choose_sources(names: Sequence[str]) -> tuple[Source, ...]:
    """The sources of the given names; SOURCES where none is given. Raises UserError for a name that does not exist."""
    known = {source.name: source for source in (*SOURCES, *PREPARED_SOURCES)}
    for name in names:
        if name not in known:
            raise UserError(f"sources: {name!r} is not one of open, {', '.join(known)}")
    return tuple(known[name] for name in names) if names else SOURCES


def read_samples(data: Path, sources: Iterable[Source], rendered: Path | None = None) -> list[Sample]:
    """Every picture of the sources, in manifest order, each file once.

    rendered: folder of the rendered source, which may lie outside `data`; without it that source is empty.
    Raises UserError where a source's manifest is missing or unreadable, or where a held-out file is also trained on.
    """
    samples: list[Sample] = []
    for source in sources:
        if source.name == RENDERED and rendered is None:
            continue
        folder = rendered if source.name == RENDERED and rendered else data / source.folder
        samples.extend(_read_source(folder, source))
    trained = {sample.picture for sample in samples if not sample.held_out and sample.mask}
    leaked = next((s.picture for s in samples if s.held_out and s.mask and s.picture in trained), None)
    if leaked is not None:
        raise UserError(f"sources: {leaked} is both trained on and held out")
    return samples


@cache
def list_pictures_without_water() -> frozenset[str]:
    """List pictures that show no water, by hand: paths below the data folder, of sources and of other folders."""
    return frozenset(WITHOUT_WATER.read_text().split())


def _read_source(folder: Path, source: Source) -> list[Sample]:
    path = folder / "manifest.json"
    try:
        items = msgspec.json.decode(path.read_bytes(), type=_Manifest).items
    except UNREADABLE as error:
        raise UserError(f"{path}: {error}") from error
    named = len({item.seq for item in items}) > 1
    seen: set[str] = set()
    samples = []
    for index, item in enumerate(items):
        if item.file in seen or (source.splits and item.split not in source.splits):
            continue
        seen.add(item.file)
        stem = Path(item.file).stem
        if stem in source.twins:
            continue
        sequence = item.seq if named or source.splits else f"run{index // _RUN_LENGTH}"
        mask = folder / source.masks / f"{stem}.png" if source.masks else None
        label = folder / source.labels / f"{stem}.txt" if source.labels else None
        if source.drawn:
            sequence, label = stem[:-1], ANNOTATIONS / source.folder / f"{stem}.txt"
        if label is not None and not label.is_file():
            if mask is None:
                continue
            label = None
        held_out = item.split != "train" if source.splits else is_held_out(source, sequence)
        without_water = f"{source.folder}/{item.file}" in list_pictures_without_water()
        samples.append(Sample(source, sequence, held_out, folder / item.file, mask, label, without_water))
    return samples


def is_held_out(source: Source, sequence: str) -> bool:
    """Whether a sequence belongs to the validation side; whole sequences only, so no near-copies leak."""
    if source.held_out:
        return sequence in source.held_out
    return zlib.crc32(sequence.encode()) % source.one_in == 0


def read_boxes(label: Path, min_score: float | None = None) -> NDArray[np.float32]:
    """YOLO text -> float32 [n,5]: class, x1, y1, x2, y2 normalised and clipped to the picture.

    min_score: each row ends with a score, and those below this are left out.
    Raises UserError where a row is malformed, a class unknown, or a box empty (R8).
    """
    rows = []
    for place, numbers in read_label_rows(label):
        try:
            kind, cx, cy, width, height = numbers[:5]
        except ValueError as error:
            raise UserError(f"{place}: {error}") from error
        x1, y1 = max(0.0, cx - width / 2), max(0.0, cy - height / 2)
        x2, y2 = min(1.0, cx + width / 2), min(1.0, cy + height / 2)
        known = kind in range(len(DETECTOR_CLASSES)) and np.isfinite((cx, cy, width, height)).all()
        if not known or not (x1 < x2 and y1 < y2):
            raise UserError(f"{place}: not a class id and a box inside the picture")
        if min_score is not None and len(numbers) < 6:
            raise UserError(f"{place}: has no score after the box")
        if min_score is None or numbers[5] >= min_score:
            rows.append((kind, x1, y1, x2, y2))
    return np.array(rows, np.float32).reshape(-1, 5)


def read_picture(path: Path) -> NDArray[np.uint8]:
    """RGB uint8 [H,W,3]. Raises UserError naming a file that is not a readable picture."""
    picture = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if picture is None:
        raise UserError(f"{path}: not a readable picture")
    return np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2RGB), np.uint8)


def read_mask(path: Path) -> NDArray[np.uint8]:
    """Segmenter classes uint8 [H,W]. Raises UserError naming a file that is not a readable mask."""
    coded = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    if coded is None:
        raise UserError(f"{path}: not a readable mask")
    return decode_mask_classes(np.asarray(coded, np.uint8))


def read_pair(sample: Sample) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Picture and mask of a segmented sample, each in its own size. Raises UserError naming an unreadable file."""
    if sample.mask is None:
        raise UserError(f"{sample.picture}: has no mask")
    return read_picture(sample.picture), read_mask(sample.mask)
