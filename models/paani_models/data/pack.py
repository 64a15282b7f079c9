"""A training bundle: every picture at the size that the nets see, in one tar of bounded size.

Unpacked, it is a data folder: `PAANI_DATA=FOLDER paani models train ...` gives the same splits as the folder it was
packed from. The same input gives the same bytes.
"""

from __future__ import annotations

import io
import tarfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import msgspec
import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from paani.errors import UserError
from paani_models.data.checked_files import decode_picture, read_bytes
from paani_models.data.inventory import FolderOf, terms_of
from paani_models.data.manifest import MANIFEST
from paani_models.network_input import SIZE_WH
from paani_models.sources import RENDERED, Sample, Source

MEGABYTE = 1_000_000
QUALITIES = (95, 92, 89, 86, 83, 80, 77, 74, 71, 68, 65, 62, 59, 56, 53, 50)  # below 50 blocks replace texture
SAMPLED_EVERY = 8  # pictures encoded at each quality before the choice
WEIGHTS_FOLDER = "_weights"
START_FOLDER = "_start"
_BLOCK = 512


class PackedItem(msgspec.Struct, frozen=True):
    """One picture of a packed source, as the source's own manifest names it."""

    file: str
    seq: str
    split: str = ""


class PackedSource(msgspec.Struct, frozen=True, kw_only=True):
    """The manifest of a packed source: its terms, and what was done to its pictures."""

    repo: str
    commit: str
    licence: str
    provenance: str
    items: tuple[PackedItem, ...]


class _Listed(msgspec.Struct, frozen=True):
    items: tuple[PackedItem, ...]


@dataclass(frozen=True)
class Packed:
    """What was written."""

    size_bytes: int
    pictures: int
    quality: int


def pack(
    out: Path,
    samples: Sequence[Sample],
    folder_of: FolderOf,
    *,
    max_mb: float,
    weights: Sequence[Path] = (),
    start: Sequence[Path] = (),
) -> Packed:
    """Write `out`: the pictures of the samples with all of their masks and labels, their manifests, and the weights.

    Pictures shrink, aspect kept, until they just cover the nets' input, and share the best JPEG quality that fits.
    Raises UserError, leaving nothing behind, for an unreadable file, and where even the lowest quality does not fit.
    """
    folders = {source.folder: folder_of(source) for source in dict.fromkeys(s.source for s in samples)}
    pictures = {s.picture: s.source for s in samples}
    other = dict(_other_files(pictures, folders, samples))
    other |= {f"{WEIGHTS_FOLDER}/{path.name}": read_bytes(path) for path in weights}
    other |= {f"{START_FOLDER}/{path.name}": read_bytes(path) for path in start}
    budget = int(max_mb * MEGABYTE)
    fixed = sum(_padded(len(data)) for data in other.values()) + 20 * _BLOCK
    shrunk: list[tuple[str, NDArray[np.uint8]]] = []
    for picture, source in tqdm(sorted(pictures.items()), "shrinking", unit="picture", mininterval=2.0):
        name = f"{source.folder}/{picture.relative_to(folders[source.folder])}"
        shrunk.append((name, covering(decode_picture(read_bytes(picture), picture))))
    if fixed + len(shrunk) * 2 * _BLOCK > budget:
        raise UserError(f"{out}: masks, labels and weights alone take {fixed / MEGABYTE:.1f} MB")
    quality = _likely_quality(shrunk, budget - fixed)
    while True:
        encoded = {name: _jpeg(picture, quality) for name, picture in tqdm(shrunk, f"JPEG {quality}", unit="picture")}
        if fixed + sum(_padded(len(data)) for data in encoded.values()) <= budget:
            break
        lower = [each for each in QUALITIES if each < quality]
        if not lower:
            raise UserError(f"{out}: {len(shrunk)} pictures do not fit into {max_mb:g} MB; choose fewer sources")
        quality = lower[0]
    for folder, root in folders.items():
        other[f"{folder}/{MANIFEST}"] = _manifest(root, folder, samples, quality)
    _write(out, {**other, **encoded})
    return Packed(out.stat().st_size, len(encoded), quality)


def covering(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Shrink, aspect kept, until the picture just covers the nets' input; never enlarge."""
    wh = covering_wh((picture.shape[1], picture.shape[0]))
    if wh == (picture.shape[1], picture.shape[0]):
        return picture
    return np.asarray(cv2.resize(picture, wh, interpolation=cv2.INTER_AREA), np.uint8)


def covering_wh(wh: tuple[int, int]) -> tuple[int, int]:
    """The size to which `covering` brings a picture."""
    scale = min(1.0, max(SIZE_WH[0] / wh[0], SIZE_WH[1] / wh[1]))
    return round(wh[0] * scale), round(wh[1] * scale)


def _jpeg(picture: NDArray[np.uint8], quality: int) -> bytes:
    bgr = cv2.cvtColor(picture, cv2.COLOR_RGB2BGR)
    return bytes(cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, quality])[1].tobytes())


def _likely_quality(shrunk: Sequence[tuple[str, NDArray[np.uint8]]], budget: int) -> int:
    sampled = shrunk[::SAMPLED_EVERY]
    for quality in QUALITIES:
        size = sum(_padded(len(_jpeg(picture, quality))) for _, picture in sampled)
        if size * len(shrunk) <= budget * max(1, len(sampled)):
            return quality
    return QUALITIES[-1]


def _other_files(
    pictures: dict[Path, Source], folders: dict[str, Path], samples: Sequence[Sample]
) -> Iterable[tuple[str, bytes]]:
    """Every mask, brought to its picture's size, and every label of the folders, the unused kinds included."""
    sizes = {}
    stems: dict[str, set[str]] = {}
    for picture, source in pictures.items():
        stems.setdefault(source.folder, set()).add(picture.stem)
    wanted = {sample.mask for sample in samples} | {sample.label for sample in samples}
    for folder, root in sorted(folders.items()):
        for path in sorted([*root.glob("masks*/*.png"), *root.glob("labels*/*.txt")]):
            if path.stem not in stems[folder]:
                continue
            name = f"{folder}/{path.relative_to(root)}"
            if path.suffix == ".txt":
                yield name, path.read_bytes()
            else:
                yield name, _small_mask(path, sizes)
    missing = next((path for path in wanted if path and not path.is_file()), None)
    if missing is not None:
        raise UserError(f"{missing}: no such file")


def _small_mask(path: Path, sizes: dict[Path, tuple[int, int]]) -> bytes:
    mask = cv2.imdecode(np.frombuffer(read_bytes(path), np.uint8), cv2.IMREAD_GRAYSCALE)
    if mask is None:
        raise UserError(f"{path}: not a readable mask")
    wh = covering_wh((mask.shape[1], mask.shape[0]))
    if wh != (mask.shape[1], mask.shape[0]):
        mask = cv2.resize(mask, wh, interpolation=cv2.INTER_NEAREST)
    return bytes(cv2.imencode(".png", mask, [cv2.IMWRITE_PNG_COMPRESSION, 9])[1].tobytes())


def _manifest(root: Path, folder: str, samples: Sequence[Sample], quality: int) -> bytes:
    """In the source's order, so that runs of pictures without a sequence are cut at the same places."""
    source = next(sample.source for sample in samples if sample.source.folder == folder)
    terms = terms_of(root, source)
    try:
        listed = msgspec.json.decode((root / MANIFEST).read_bytes(), type=_Listed).items
    except (OSError, msgspec.MsgspecError) as error:
        raise UserError(f"{root / MANIFEST}: {error}") from error
    packed = PackedSource(
        repo=terms.repo,
        commit=terms.commit,
        licence=terms.licence,
        provenance=f"pictures shrunk to cover {SIZE_WH[0]}x{SIZE_WH[1]}, JPEG quality {quality}; masks by nearest pixel",
        items=listed,
    )
    return msgspec.json.encode(packed)


def _padded(size: int) -> int:
    return _BLOCK + -(-size // _BLOCK) * _BLOCK


def _write(out: Path, files: dict[str, bytes]) -> None:
    beside = out.with_name(out.name + ".partial")
    try:
        with tarfile.open(beside, "w", format=tarfile.USTAR_FORMAT) as bundle:
            for name, data in sorted(files.items()):
                entry = tarfile.TarInfo(name)
                entry.size, entry.mode, entry.mtime = len(data), 0o644, 0
                bundle.addfile(entry, io.BytesIO(data))
        beside.replace(out)
    except (OSError, ValueError) as error:
        raise UserError(f"{out}: {error}") from error
    finally:
        beside.unlink(missing_ok=True)


def rendered_folder(unpacked: Path) -> Path | None:
    """Where rendered pictures lie in an unpacked bundle, if any were packed."""
    folder = unpacked / RENDERED
    return folder if folder.is_dir() else None
