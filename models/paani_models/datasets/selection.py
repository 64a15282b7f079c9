"""Select the annotated pictures that a command works on, by source and by side of the split."""

from __future__ import annotations

import sys
from pathlib import Path

from paani.errors import UserError
from paani_models.datasets.checked_files import read_yolo
from paani_models.datasets.sources import (
    DETECTOR_CLASSES,
    RENDERED,
    Sample,
    Source,
    choose_sources,
    read_samples,
)
from paani_models.datasets.terms import OPEN, OPEN_TERMS, refusal_of_terms


def source_names(text: str) -> list[str]:
    """An argparse `type`: names separated by commas; none for all sources. Raises UserError for an empty one."""
    names = text.split(",") if text else []
    if "" in names:
        raise UserError(f"--sources {text}: names of sources, separated by commas")
    return names


class PictureSelection:
    """The chosen sources below a data folder, and a folder of rendered pictures: as given, or that of a bundle.

    The name "open" stands for the sources that anyone may use, as far as their manifests agree.
    A source without its manifest, and a picture with a malformed label or a box outside it, are named on stderr,
    counted and left out; with `strict` they raise UserError where they are read.
    """

    def __init__(self, data: Path, names: list[str], rendered: Path | None, *, strict: bool = False) -> None:
        if not data.is_dir():
            raise UserError(f"{data}: no such folder; set PAANI_DATA or --data")
        packed = data / RENDERED
        self.data, self.rendered = data, rendered or (packed if (packed / "manifest.json").is_file() else None)
        only_open = OPEN in names
        expanded = dict.fromkeys(name for given in names for name in (OPEN_TERMS if given == OPEN else (given,)))
        self.sources: tuple[Source, ...] = choose_sources(list(expanded))
        self.skipped: list[str] = []
        if not strict:
            self.sources = self._sources_with_manifests()
        if only_open:
            self.sources = self._sources_anyone_may_use()
        self.samples = read_samples(data, self.sources, self.rendered)
        if not strict:
            self.samples = [sample for sample in self.samples if self._has_sound_boxes(sample)]
        sys.stderr.write("".join(f"skipped {line}\n" for line in self.skipped))
        if self.skipped:
            sys.stderr.write(f"skipped {len(self.skipped)} in all, named above\n")

    def _sources_with_manifests(self) -> tuple[Source, ...]:
        """Raises UserError naming the first manifest that is missing where none is left."""
        kept = []
        for source in self.sources:
            manifest = self.source_folder(source) / "manifest.json"
            if manifest.is_file() or (source.name == RENDERED and self.rendered is None):
                kept.append(source)
            else:
                self.skipped.append(f"source {source.name}: {manifest}: missing")
        if not any(source.name != RENDERED or self.rendered is not None for source in kept):
            raise UserError(self.skipped[0] if self.skipped else "sources: none")
        return tuple(kept)

    def _sources_anyone_may_use(self) -> tuple[Source, ...]:
        """Raises UserError where none is left."""
        kept = []
        for source in self.sources:
            refusal = refusal_of_terms(source.name, self.source_folder(source) / "manifest.json")
            if refusal:
                self.skipped.append(f"source {source.name}: {refusal}")
            else:
                kept.append(source)
        if self.rendered is None and all(source.name == RENDERED for source in kept):
            raise UserError(self.skipped[-1])
        return tuple(kept)

    def _has_sound_boxes(self, sample: Sample) -> bool:
        if sample.label is None:
            return True
        try:
            read_yolo(sample.label, len(DETECTOR_CLASSES))
        except UserError as error:
            self.skipped.append(f"picture {sample.picture.name}: {error}")
            return False
        return True

    def source_folder(self, source: Source) -> Path:
        """Where a source lies."""
        return self.rendered if source.name == RENDERED and self.rendered else self.data / source.folder

    def segmented_samples(self, held_out: bool) -> list[Sample]:
        """Samples with a mask."""
        return [s for s in self.samples if s.mask and s.held_out == held_out]

    def boxed_samples(self, held_out: bool) -> list[Sample]:
        """Samples with boxes; for training also those whose mask tells where nothing floats.

        A picture that is held out for its boxes is not trained on for its mask.
        """
        if held_out:
            return [s for s in self.samples if s.held_out and s.label]
        held_out_pictures = {s.picture for s in self.samples if s.held_out and s.label}
        return [s for s in self.samples if not s.held_out and s.picture not in held_out_pictures]

    def training_samples(self) -> list[Sample]:
        """Every picture that no source holds out, once."""
        held_out_pictures = {s.picture for s in self.samples if s.held_out}
        return list({s.picture: s for s in self.samples if s.picture not in held_out_pictures}.values())

    def unsegmented_samples(self) -> list[Sample]:
        """Training samples of the sources that have boxes and no masks, each picture once."""
        masked = {s.picture for s in self.samples if s.mask}
        return [s for s in self.samples if not s.source.masks and not s.held_out and s.picture not in masked]
