"""Add checked pictures to a new prepared folder, which appears complete or not at all."""

from __future__ import annotations

import os
import shutil
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import msgspec
import numpy as np
from numpy.typing import NDArray

from paani.errors import UserError
from paani_models.datasets.checked_files import Box, decode_picture, raise_first_mistake, read_whole_file, sha256_hex
from paani_models.datasets.leaks import Fingerprint, Leak, find_leaks, fingerprint_picture, refuse_leaks
from paani_models.datasets.manifest import MANIFEST, Entry, SourceManifest, Split, encode_manifest
from paani_models.datasets.sources import DETECTOR_CLASSES


def link_or_copy(source: Path, target: Path) -> None:
    """The same bytes under another name; linked where the file system can, as public sets are large."""
    target.parent.mkdir(parents=True, exist_ok=True)
    try:
        os.link(source.resolve(), target)
    except OSError:
        shutil.copyfile(source, target)


@dataclass
class Intake:
    """Collects the pictures added and the mistakes found, so that one run reports every mistake of a set."""

    out: Path
    source: str
    entries: list[Entry] = field(default_factory=list)
    fingerprints: list[Fingerprint] = field(default_factory=list)
    mistakes: list[str] = field(default_factory=list)

    def add(
        self,
        path: Path,
        *,
        split: Split,
        sequence: str = "",
        boxes: Sequence[Box] | None = None,
        mask: NDArray[np.uint8] | None = None,
    ) -> None:
        """Take one picture with its boxes (our classes) or its mask (file codes). A bad picture is a mistake."""
        try:
            data = read_whole_file(path)
            picture = decode_picture(data, path)
        except UserError as error:
            self.mistakes.append(str(error))
            return
        counts = [sum(box.kind == kind for box in boxes or ()) for kind in range(len(DETECTOR_CLASSES))]
        entry = Entry(
            file=f"images/{path.name}",
            seq=sequence,
            split=split,
            sha256=sha256_hex(data),
            wh=(picture.shape[1], picture.shape[0]),
            mask=f"masks/{path.stem}.png" if mask is not None else "",
            label=f"labels/{path.stem}.txt" if boxes is not None else "",
            boxes=(counts[0], counts[1], counts[2], counts[3]),
        )
        link_or_copy(path, self.out / entry.file)
        if boxes is not None:
            (self.out / "labels").mkdir(exist_ok=True)
            (self.out / entry.label).write_text(format_labels(boxes), encoding="ascii")
        if mask is not None:
            (self.out / "masks").mkdir(exist_ok=True)
            if not cv2.imwrite(str(self.out / entry.mask), mask):
                raise UserError(f"{self.out / entry.mask}: cannot be written (is the disk full?)")
        self.entries.append(entry)
        self.fingerprints.append(
            fingerprint_picture(
                picture,
                source=self.source,
                identity=path.stem,
                sequence=sequence,
                split=split,
                location=str(path),
                sha256=entry.sha256,
            )
        )

    def write_manifest(self, terms: SourceManifest, *, strict: bool) -> tuple[SourceManifest, list[Leak]]:
        """Write the manifest: `terms` with what was taken.

        Returns it and the leaks that were let pass. Raises UserError for mistakes so far; and for leaks, if strict.
        """
        raise_first_mistake(self.mistakes)
        leaks = find_leaks(self.fingerprints)
        if strict:
            refuse_leaks(leaks)
        manifest = msgspec.structs.replace(terms, items=tuple(self.entries))
        (self.out / MANIFEST).write_bytes(encode_manifest(manifest))
        return manifest, leaks


def format_labels(boxes: Sequence[Box]) -> str:
    """YOLO rows."""
    return "".join(f"{b.kind} {b.cx:.6f} {b.cy:.6f} {b.width:.6f} {b.height:.6f}\n" for b in boxes)
