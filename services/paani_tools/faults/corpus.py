"""Annotated pictures to spoil: clean pictures with their class masks, and views without water cut from above it."""

from pathlib import Path
from typing import NamedTuple, TypeVar

import cv2
import msgspec
import numpy as np

from paani.arrays import U8
from paani.errors import UserError
from paani.undecodable import UNREADABLE

T = TypeVar("T")
SIZE_WH = (320, 240)
SUFFIXES = frozenset({".jpg", ".jpeg", ".png"})
# Mask folders by preference, coded 0 obstacle, 1 water, 2 sky, 255 unknown.
MASK_FOLDERS = ("masks3", "masks")
CLASS_OF = np.full(256, 255, np.uint8)
CLASS_OF[:3] = (1, 0, 2)  # to water 0, obstacle 1, sky 2 (D6)


class Scene(NamedTuple):
    """A picture BGR uint8 [240, 320, 3] and its mask uint8 [240, 320] (0 water, 1 obstacle, 2 sky, 255 unknown)."""

    source: str
    sequence: str
    picture: U8
    mask: U8


class _Item(msgspec.Struct):
    file: str
    seq: str = ""


class _Manifest(msgspec.Struct):
    items: list[_Item]


def find_source_folders(folder: Path) -> list[Path]:
    """Sub-folders that hold annotated pictures. Raises UserError when there is none."""
    found = [path.parent for path in sorted(folder.glob("*/manifest.json"))]
    if not found:
        raise UserError(f"{folder}: no sub-folder with a manifest.json")
    return found


def read_clean_pictures(source: Path, at_most: int, only: frozenset[str] | None = None) -> list[U8]:
    """Pictures of a source as they are, evenly spread over it. only: paths below the data folder; None: all."""
    paths = sorted(
        path
        for path in (source / "images").glob("*")
        if path.suffix.lower() in SUFFIXES and (only is None or _relative_name(source, path) in only)
    )
    read = (cv2.imread(str(path), cv2.IMREAD_COLOR) for path in spread_evenly(paths, at_most))
    return [np.asarray(picture, np.uint8) for picture in read if picture is not None]


def read_listed_pictures(folder: Path, names: frozenset[str]) -> list[U8]:
    """The pictures of these paths below a folder. Raises UserError naming the first that is none."""
    found = []
    for name in sorted(names):
        picture = cv2.imread(str(folder / name), cv2.IMREAD_COLOR)
        if picture is None:
            raise UserError(f"{folder / name}: not a readable picture")
        found.append(np.asarray(picture, np.uint8))
    return found


def read_scenes(source: Path, at_most: int, only: frozenset[str] | None = None) -> list[Scene]:
    """Pictures with masks of all three classes, evenly spread; none where the source has no such masks."""
    manifest = source / "manifest.json"
    try:
        items = msgspec.json.decode(manifest.read_bytes(), type=_Manifest).items
    except UNREADABLE as error:
        raise UserError(f"{manifest}: {error}") from error
    folders = [source / name for name in MASK_FOLDERS if (source / name).is_dir()]
    if not folders:
        return []
    found = []
    items = [item for item in items if only is None or f"{source.name}/{item.file}" in only]
    for item in spread_evenly(sorted(items, key=lambda i: i.file), at_most):
        picture = cv2.imread(str(source / item.file), cv2.IMREAD_COLOR)
        mask = cv2.imread(str(folders[0] / f"{Path(item.file).stem}.png"), cv2.IMREAD_GRAYSCALE)
        if picture is None or mask is None:
            continue
        small = np.asarray(cv2.resize(picture, SIZE_WH, interpolation=cv2.INTER_AREA), np.uint8)
        classes = CLASS_OF[cv2.resize(mask, SIZE_WH, interpolation=cv2.INTER_NEAREST)]
        found.append(Scene(source.name, item.seq, small, np.asarray(classes, np.uint8)))
    return found


def spread_evenly(items: list[T], at_most: int) -> list[T]:
    """Take at most so many items, at even distances."""
    if len(items) <= at_most:
        return items
    return [items[round(i * (len(items) - 1) / max(1, at_most - 1))] for i in range(at_most)]


def _relative_name(source: Path, path: Path) -> str:
    return path.relative_to(source.parent).as_posix()
