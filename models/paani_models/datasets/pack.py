"""Pack a training bundle: every picture at the size of the networks' input, in one tar of bounded size.

Unpacked, it is a data folder: `PAANI_DATA=FOLDER paani models train ...` gives the same splits as the folder it was
packed from. The same input gives the same bytes.
"""

from __future__ import annotations

import gzip
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
from paani.undecodable import UNREADABLE
from paani.whole_file import write_whole
from paani_models.datasets.checked_files import decode_picture, read_whole_file
from paani_models.datasets.inventory import FolderOf, read_terms
from paani_models.datasets.manifest import MANIFEST
from paani_models.datasets.sources import Sample, Source
from paani_models.network_input import SIZE_WH

MEGABYTE = 1_000_000
QUALITIES = tuple(range(95, 42, -3))  # below, blocks replace texture
SAMPLED_EVERY = 8  # pictures encoded at each quality before the choice
WEIGHTS_FOLDER = "_weights"
START_FOLDER = "_start"
COMPRESSED = frozenset({".gz", ".tgz"})

_PLAIN_ENTRY, _PACKED_ENTRY = 768, 100  # bytes that a file costs beside its own: header and padding


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


class _SourceItems(msgspec.Struct, frozen=True):
    items: tuple[PackedItem, ...]


@dataclass(frozen=True)
class PackedBundle:
    """Size, number of pictures and JPEG quality of the bundle written."""

    size_bytes: int
    pictures: int
    quality: int


def pack_bundle(
    out: Path,
    samples: Sequence[Sample],
    folder_of: FolderOf,
    *,
    max_mb: float,
    weights: Sequence[Path] = (),
    start: Sequence[Path] = (),
) -> PackedBundle:
    """Write `out`, a tar, gzipped where its name says so: pictures with all of their masks and labels, and weights.

    Pictures shrink, aspect kept, until they just cover the networks' input, and share the best JPEG quality that fits.
    Raises UserError, leaving nothing behind, for an unreadable file, and where even the lowest quality does not fit.
    """
    folders = {source.folder: folder_of(source) for source in dict.fromkeys(s.source for s in samples)}
    pictures = {s.picture: s.source for s in samples}
    other = dict(_other_files(pictures, folders, samples))
    for option, paths in (("--weights", weights), ("--start", start)):
        names_given = [path.name for path in paths]
        if twice := next((name for name in names_given if names_given.count(name) > 1), ""):
            raise UserError(f"{option}: two files are called {twice}")
    other |= {f"{WEIGHTS_FOLDER}/{path.name}": read_whole_file(path) for path in weights}
    other |= {f"{START_FOLDER}/{path.name}": read_whole_file(path) for path in start}
    names = {
        f"{source.folder}/{picture.relative_to(folders[source.folder])}": picture
        for picture, source in sorted(pictures.items())
    }
    if not names:
        raise UserError("sources: no picture to pack")
    compress = out.suffix in COMPRESSED
    budget = int(max_mb * MEGABYTE)
    fixed = len(_build_tar(other, compress)) + len(names) * (_PACKED_ENTRY if compress else _PLAIN_ENTRY)
    if fixed >= budget:
        raise UserError(f"{out}: masks, labels and weights alone take {fixed / MEGABYTE:.1f} MB")
    first = _likely_quality(list(names.values()), budget - fixed)
    for quality in (each for each in QUALITIES if each <= first):
        bar = tqdm(names.items(), f"JPEG {quality}", unit="picture", mininterval=2.0)
        encoded = {name: _encode_jpeg(_read_shrunk(path), quality) for name, path in bar}
        listed = {
            f"{folder}/{MANIFEST}": _encode_packed_manifest(root, folder, samples, quality)
            for folder, root in folders.items()
        }
        archive = _build_tar({**other, **listed, **encoded}, compress)
        if len(archive) <= budget:
            write_whole(out, archive)
            return PackedBundle(len(archive), len(encoded), quality)
    raise UserError(f"{out}: {len(names)} pictures do not fit into {max_mb:g} MB; choose fewer sources")


def shrink_to_cover(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Shrink, aspect kept, until the picture just covers the networks' input; never enlarge."""
    wh = cover_size_wh((picture.shape[1], picture.shape[0]))
    if wh == (picture.shape[1], picture.shape[0]):
        return picture
    return np.asarray(cv2.resize(picture, wh, interpolation=cv2.INTER_AREA), np.uint8)


def cover_size_wh(wh: tuple[int, int]) -> tuple[int, int]:
    """The size to which `shrink_to_cover` brings a picture."""
    scale = min(1.0, max(SIZE_WH[0] / wh[0], SIZE_WH[1] / wh[1]))
    return round(wh[0] * scale), round(wh[1] * scale)


def _read_shrunk(path: Path) -> NDArray[np.uint8]:
    return shrink_to_cover(decode_picture(read_whole_file(path), path))


def _encode_jpeg(picture: NDArray[np.uint8], quality: int) -> bytes:
    bgr = cv2.cvtColor(picture, cv2.COLOR_RGB2BGR)
    options = [cv2.IMWRITE_JPEG_QUALITY, quality, cv2.IMWRITE_JPEG_OPTIMIZE, 1, cv2.IMWRITE_JPEG_PROGRESSIVE, 1]
    return bytes(cv2.imencode(".jpg", bgr, options)[1].tobytes())


def _likely_quality(paths: Sequence[Path], budget: int) -> int:
    sampled = [_read_shrunk(path) for path in paths[::SAMPLED_EVERY]]
    for quality in QUALITIES:
        size = sum(len(_encode_jpeg(picture, quality)) for picture in sampled)
        if size * len(paths) <= budget * len(sampled):
            return quality
    return QUALITIES[-1]


def _other_files(
    pictures: dict[Path, Source], folders: dict[str, Path], samples: Sequence[Sample]
) -> Iterable[tuple[str, bytes]]:
    """Every mask, brought to its picture's size, and every label of the folders, the unused kinds included."""
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
                yield name, _shrink_mask(path)
    missing = next((path for path in wanted if path and not path.is_file()), None)
    if missing is not None:
        raise UserError(f"{missing}: no such file")


def _shrink_mask(path: Path) -> bytes:
    mask = cv2.imdecode(np.frombuffer(read_whole_file(path), np.uint8), cv2.IMREAD_GRAYSCALE)
    if mask is None:
        raise UserError(f"{path}: not a readable mask")
    wh = cover_size_wh((mask.shape[1], mask.shape[0]))
    if wh != (mask.shape[1], mask.shape[0]):
        mask = cv2.resize(mask, wh, interpolation=cv2.INTER_NEAREST)
    return bytes(cv2.imencode(".png", mask, [cv2.IMWRITE_PNG_COMPRESSION, 9])[1].tobytes())


def _encode_packed_manifest(root: Path, folder: str, samples: Sequence[Sample], quality: int) -> bytes:
    """In the source's order, so that runs of pictures without a sequence are cut at the same places."""
    source = next(sample.source for sample in samples if sample.source.folder == folder)
    terms = read_terms(root, source)
    try:
        listed = msgspec.json.decode((root / MANIFEST).read_bytes(), type=_SourceItems).items
    except UNREADABLE as error:
        raise UserError(f"{root / MANIFEST}: {error}") from error
    packed = PackedSource(
        repo=terms.repo,
        commit=terms.commit,
        licence=terms.licence,
        provenance=f"shrunk to cover {SIZE_WH[0]}x{SIZE_WH[1]}, JPEG quality {quality}; masks by nearest pixel",
        items=listed,
    )
    return msgspec.json.encode(packed)


def _build_tar(files: dict[str, bytes], compress: bool) -> bytes:
    buffer = io.BytesIO()
    with tarfile.open(fileobj=buffer, mode="w", format=tarfile.USTAR_FORMAT) as bundle:
        for name, data in sorted(files.items()):
            entry = tarfile.TarInfo(name)
            entry.size, entry.mode, entry.mtime = len(data), 0o644, 0
            bundle.addfile(entry, io.BytesIO(data))
    return gzip.compress(buffer.getvalue(), 6, mtime=0) if compress else buffer.getvalue()
