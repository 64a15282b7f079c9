"""Read every training and held-out file once: count and check them, and search for leaks between the splits."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import msgspec
from tqdm import tqdm

from paani.errors import UserError
from paani.undecodable import UNREADABLE
from paani.whole_file import write_json
from paani_models.datasets.checked_files import decode_picture, raise_first_mistake, read_whole_file, sha256_hex
from paani_models.datasets.leaks import Fingerprint, Leak, find_leaks, fingerprint_picture
from paani_models.datasets.manifest import Entry, MaskKind, SourceManifest, load_manifest
from paani_models.datasets.sources import DETECTOR_CLASSES, RENDERED, Sample, Source, read_boxes, read_mask

FolderOf = Callable[[Source], Path]


@dataclass(frozen=True)
class ReadSample:
    """A sample, its manifest entry, and its fingerprint."""

    sample: Sample
    entry: Entry
    fingerprint: Fingerprint


class _Terms(msgspec.Struct, frozen=True):
    repo: str = ""
    commit: str = ""
    licence: str = "not stated"
    origin: str = ""


def read_all_samples(samples: Sequence[Sample], folder_of: FolderOf) -> list[ReadSample]:
    """Decode every picture, mask and label once.

    Raises UserError naming the first bad file and counting the others: missing, truncated or unreadable pictures and
    masks, a mask of another size than its picture, a bad box (R8), a picture of a prepared public set whose
    checksum is no longer that of its manifest.
    """
    seen: list[ReadSample] = []
    mistakes: list[str] = []
    prepared = {s.source: folder_of(s.source) for s in samples if s.source.splits}
    sums = {folder / e.file: e.sha256 for folder in prepared.values() for e in load_manifest(folder).items}
    for sample in tqdm(samples, "reading", unit="picture", mininterval=2.0):
        try:
            item = _read_sample(sample, folder_of(sample.source))
            if sums.get(sample.picture, item.entry.sha256) != item.entry.sha256:
                raise UserError(f"{sample.picture}: differs from its manifest")
            seen.append(item)
        except UserError as error:
            mistakes.append(str(error))
    raise_first_mistake(mistakes)
    return seen


def find_segmenter_leaks(seen: Sequence[ReadSample]) -> list[Leak]:
    """Between the pictures whose masks the segmenter learns and those that it is scored on."""
    return find_leaks([item.fingerprint for item in seen if item.sample.mask])


def find_detector_leaks(seen: Sequence[ReadSample]) -> list[Leak]:
    """Between the pictures that the detector learns, masks alone included, and those whose boxes score it.

    A picture that is held out for its boxes counts as held out, whatever its mask is used for.
    """
    boxed = [item.fingerprint for item in seen if item.sample.held_out and item.sample.label]
    kept = {item.identity for item in boxed}
    learnt = [item.fingerprint for item in seen if not item.sample.held_out and item.fingerprint.identity not in kept]
    return find_leaks([*learnt, *boxed])


def build_manifests(seen: Sequence[ReadSample], folder_of: FolderOf) -> tuple[SourceManifest, ...]:
    """One per source, in the order of the samples."""
    found = []
    for source in dict.fromkeys(item.sample.source for item in seen):
        terms = read_terms(folder_of(source), source)
        mask: MaskKind = "none" if not source.masks else "three_class"
        found.append(
            SourceManifest(
                source=source.name,
                repo=terms.repo,
                commit=terms.commit,
                licence=terms.licence,
                provenance=terms.origin or f"{source.folder} of the data folder",
                mask=mask,
                annotated=tuple(kind for kind in DETECTOR_CLASSES if kind in source.annotated),
                items=tuple(item.entry for item in seen if item.sample.source == source),
            )
        )
    return tuple(found)


def read_terms(folder: Path, source: Source) -> _Terms:
    """What a folder's manifest states of its origin. Raises UserError naming one that is missing or malformed."""
    path = folder / "manifest.json"
    try:
        stated = msgspec.json.decode(path.read_bytes(), type=_Terms)
    except UNREADABLE as error:
        raise UserError(f"{path}: {error}") from error
    return (
        msgspec.structs.replace(stated, repo="paani_sim", licence="Apache-2.0") if source.name == RENDERED else stated
    )


def format_counts(seen: Sequence[ReadSample]) -> str:
    """One line per source and side: pictures, masks and boxes per class."""
    rows: dict[tuple[str, str], Counter[str]] = {}
    for item in seen:
        side = "held out" if item.sample.held_out else "train"
        row = rows.setdefault((item.sample.source.name, side), Counter())
        row["pictures"] += 1
        row["masks"] += int(item.sample.mask is not None)
        row.update(dict(zip(DETECTOR_CLASSES, item.entry.boxes, strict=True)))
    return "".join(
        f"{name} ({side}): {', '.join(f'{count} {what}' for what, count in row.items() if count)}\n"
        for (name, side), row in rows.items()
    )


def check_own_pictures(samples: Sequence[Sample], folder_of: FolderOf, manifest: Path | None = None) -> None:
    """Read everything, print the counts, write the manifests as one file if wanted.

    Raises UserError for whatever `read_all_samples` refuses, and where a held-out picture leaks into training, naming
    both pictures of each pair.
    """
    seen = read_all_samples(samples, folder_of)
    sys.stdout.write(format_counts(seen))
    if manifest is not None:
        write_json(manifest, build_manifests(seen, folder_of))
    leaks = {str(leak): net for net, found in _find_leaks_by_network(seen).items() for leak in found}
    for text, net in leaks.items():
        sys.stderr.write(f"{net}: {text}\n")
    if leaks:
        raise UserError(f"splits leak: {len(leaks)} pairs of a training and a held-out picture, named above")


def _find_leaks_by_network(seen: Sequence[ReadSample]) -> dict[str, list[Leak]]:
    return {"detector": find_detector_leaks(seen), "segmenter": find_segmenter_leaks(seen)}


def _read_sample(sample: Sample, folder: Path) -> ReadSample:
    data = read_whole_file(sample.picture)
    picture = decode_picture(data, sample.picture)
    height, width = picture.shape[:2]
    boxes = [0] * len(DETECTOR_CLASSES)
    if sample.mask is not None:
        read_whole_file(sample.mask)
        mask = read_mask(sample.mask)
        if mask.shape != (height, width):
            raise UserError(f"{sample.mask}: {mask.shape[1]}x{mask.shape[0]}, its picture is {width}x{height}")
    if sample.label is not None:
        for kind in read_boxes(sample.label)[:, 0]:
            boxes[int(kind)] += 1
    entry = Entry(
        file=str(sample.picture.relative_to(folder)),
        seq=sample.sequence,
        split="val" if sample.held_out else "train",
        sha256=sha256_hex(data),
        wh=(width, height),
        mask=str(sample.mask.relative_to(folder)) if sample.mask else "",
        label=f"{sample.label.parent.name}/{sample.label.name}" if sample.label else "",
        boxes=(boxes[0], boxes[1], boxes[2], boxes[3]),
    )
    seen = fingerprint_picture(
        picture,
        source=str(folder),
        identity=str(sample.picture),
        sequence=sample.sequence,
        split="held out" if sample.held_out else "train",
        location=str(sample.picture),
        sha256=entry.sha256,
    )
    return ReadSample(sample, entry, seen)
