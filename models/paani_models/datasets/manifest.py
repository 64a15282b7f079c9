"""Manifest of a folder of prepared pictures: each file, its checksum and split, and the source's terms."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Literal

import msgspec

from paani.errors import UserError
from paani.undecodable import UNREADABLE
from paani.whole_file import indented_json
from paani_models.datasets.sources import DETECTOR_CLASSES

MANIFEST = "manifest.json"
SPLITS: tuple[Split, ...] = ("train", "val", "test")

Split = Literal["train", "val", "test"]
MaskKind = Literal["none", "three_class", "water"]


class Entry(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One picture. Paths are relative to the folder; `mask` and `label` are "" where there is none.

    seq: whole sequences belong to one split; "" where the maker tells none. boxes: counted by class, in the
    detector's order; (0, 0, 0, 0) where `label` is "".
    """

    file: str
    seq: str
    split: Split
    sha256: str
    wh: tuple[int, int]
    mask: str = ""
    label: str = ""
    boxes: tuple[int, int, int, int] = (0, 0, 0, 0)


class SourceManifest(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One source: where it came from, under which terms, what its pictures annotate, and the pictures.

    annotated: detector classes whose every instance is boxed. mask: "three_class" files hold 0 obstacle, 1 water,
    2 sky, 255 ignored; "water" files hold 0 the rest, 1 water.
    """

    source: str
    repo: str
    commit: str
    licence: str
    provenance: str
    mask: MaskKind
    annotated: tuple[str, ...] = ()
    items: tuple[Entry, ...] = ()


class BoxCounts(msgspec.Struct, frozen=True):
    """Pictures and boxes per class of one split, as the paper's table of prepared samples has them (R5 - R7)."""

    split: Split
    images: int
    person: int
    vessel: int
    pier: int
    buoy: int


def load_manifest(folder: Path) -> SourceManifest:
    """Raises UserError naming a manifest that is missing or malformed, or names a picture twice."""
    path = folder / MANIFEST
    try:
        manifest = msgspec.json.decode(path.read_bytes(), type=SourceManifest)
    except UNREADABLE as error:
        raise UserError(f"{path}: {error}") from error
    twice = [name for name, count in Counter(item.file for item in manifest.items).items() if count > 1]
    if twice:
        raise UserError(f"{path}: names {twice[0]} twice")
    return manifest


def encode_manifest(value: msgspec.Struct | tuple[msgspec.Struct, ...]) -> bytes:
    """Deterministic, readable JSON."""
    return indented_json(value)


def count_boxes(manifest: SourceManifest) -> tuple[BoxCounts, ...]:
    """One row for each split that has pictures."""
    rows = []
    for split in SPLITS:
        items = [item for item in manifest.items if item.split == split]
        if items:
            totals = [sum(item.boxes[kind] for item in items) for kind in range(len(DETECTOR_CLASSES))]
            rows.append(BoxCounts(split, len(items), *totals))
    return tuple(rows)


def format_counts_table(rows: tuple[BoxCounts, ...]) -> str:
    """Aligned text: split, images, person, vessel, pier, buoy."""
    lines = [f"{'split':6} {'images':>7} " + " ".join(f"{name:>7}" for name in DETECTOR_CLASSES)]
    lines += [f"{r.split:6} {r.images:7,} {r.person:7,} {r.vessel:7,} {r.pier:7,} {r.buoy:7,}" for r in rows]
    return "\n".join(lines) + "\n"
