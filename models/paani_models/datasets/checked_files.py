"""Read files from outside: complete and well-formed, or refused by name."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from paani.arrays import U8
from paani.errors import UserError

MIN_SIDE_PX = 16  # of a picture; less than the deepest stride of either network holds nothing to learn
EDGE_SLACK = 0.01  # share of the picture by which a box may pass its edge, as annotators round; it is clipped
MIN_SIDE_FRAC = 1e-4  # of a box: a fifth of a pixel of a wide picture; less is a mistake of the annotator
_ENDINGS = {b"\xff\xd8": (b"\xff\xd9", 1024), b"\x89P": (b"IEND\xaeB`\x82", 16)}


@dataclass(frozen=True)
class Box:
    """A class id and a box, centre and size, as shares of the picture."""

    kind: int
    cx: float
    cy: float
    width: float
    height: float


def read_whole_file(path: Path) -> bytes:
    """Raises UserError naming a file that is missing, empty or cut short (JPEG and PNG)."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise UserError(f"{path}: {error.strerror}") from error
    if not data:
        raise UserError(f"{path}: empty")
    ending, within = _ENDINGS.get(data[:2], (b"", 1))
    if ending not in data[-within:]:
        raise UserError(f"{path}: cut short")
    return data


def sha256_hex(data: bytes) -> str:
    """Hexadecimal."""
    return hashlib.sha256(data).hexdigest()


def decode_picture(data: bytes, path: Path) -> U8:
    """RGB uint8 [H,W,3]. Raises UserError naming what is no picture, or one too small to show anything."""
    picture = _decode(data, cv2.IMREAD_COLOR)
    if picture is None:
        raise UserError(f"{path}: not a readable picture")
    if min(picture.shape[:2]) < MIN_SIDE_PX:
        raise UserError(f"{path}: {picture.shape[1]}x{picture.shape[0]} is too small")
    return np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2RGB), np.uint8)


def decode_mask(data: bytes, path: Path, codes: frozenset[int], wh: tuple[int, int]) -> U8:
    """Codes as they are in the file, uint8 [H,W].

    Raises UserError naming a file that is no picture, has colours or more than 8 bits, another size than `wh`, or a
    code outside `codes`.
    """
    mask = _decode(data, cv2.IMREAD_UNCHANGED)
    if mask is None:
        raise UserError(f"{path}: not a readable mask")
    if mask.ndim == 3 and (mask == mask[..., :1]).all():
        mask = mask[..., 0]
    if mask.ndim != 2 or mask.dtype != np.uint8:
        raise UserError(f"{path}: a mask is 8-bit grey, this one has {mask.dtype} {mask.shape}")
    if (mask.shape[1], mask.shape[0]) != wh:
        raise UserError(f"{path}: {mask.shape[1]}x{mask.shape[0]}, its picture is {wh[0]}x{wh[1]}")
    strange = sorted(set(np.unique(mask).tolist()) - codes)
    if strange:
        raise UserError(f"{path}: unknown class {strange[0]}")
    return np.asarray(mask, np.uint8)


def _decode(data: bytes, flags: int) -> NDArray[np.generic] | None:
    try:
        picture = cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    except cv2.error:  # larger than the decoder's own limit
        return None
    return None if picture is None else np.asarray(picture)


def read_yolo(path: Path, kinds: int) -> tuple[Box, ...]:
    """Rows `class cx cy width height`, all shares of the picture (R8).

    Raises UserError naming file and line of a row that is malformed or not finite, of an unknown class, and of a box
    without area or outside the picture. Boxes end inside it.
    """
    return tuple(_parse_row(numbers, place, kinds) for place, numbers in read_label_rows(path))


def read_label_rows(path: Path) -> Iterator[tuple[str, list[float]]]:
    """Where each row of a label file stands, and its numbers.

    Raises UserError naming a file that cannot be read as text, or the line of what is no number.
    """
    try:
        text = path.read_text(encoding="ascii")
    except (OSError, UnicodeDecodeError) as error:
        raise UserError(f"{path}: {error}") from error
    for number, line in enumerate(text.splitlines(), 1):
        if fields := line.split():
            try:
                yield f"{path}:{number}", [float(field) for field in fields]
            except ValueError as error:
                raise UserError(f"{path}:{number}: {error}") from error


def _parse_row(numbers: list[float], place: str, kinds: int) -> Box:
    try:
        kind, cx, cy, width, height = numbers
    except ValueError as error:
        raise UserError(f"{place}: {error}") from error
    if not np.isfinite((kind, cx, cy, width, height)).all():
        raise UserError(f"{place}: not finite")
    if kind not in range(kinds):
        raise UserError(f"{place}: unknown class {kind:g}")
    if not (0.0 < width <= 1.0 and 0.0 < height <= 1.0):
        raise UserError(f"{place}: a box without area, or larger than the picture")
    ends = np.array(((cx - width / 2, cy - height / 2), (cx + width / 2, cy + height / 2)))
    if ends.min() < -EDGE_SLACK or ends.max() > 1.0 + EDGE_SLACK:
        raise UserError(f"{place}: a box outside the picture")
    low, high = np.clip(ends, 0.0, 1.0)
    if (high - low).min() < MIN_SIDE_FRAC:
        raise UserError(f"{place}: a box without area inside the picture")
    centre, size = (low + high) / 2, high - low
    return Box(int(kind), float(centre[0]), float(centre[1]), float(size[0]), float(size[1]))


def raise_first_mistake(mistakes: list[str]) -> None:
    """Raise UserError with the first mistake and how many more there are; nothing where there is none."""
    if mistakes:
        more = f" (and {len(mistakes) - 1} more)" if len(mistakes) > 1 else ""
        raise UserError(f"{mistakes[0]}{more}")
