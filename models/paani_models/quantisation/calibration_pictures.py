"""Calibration pictures of an INT8 network: never those that its acceptance test is decided on (T4, T6)."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path

from paani.errors import UserError
from paani_models.datasets.sources import RENDERED, Sample

CALIBRATION_PICTURES = 200  # T4


def choose_calibration_samples(samples: Sequence[Sample], listed: Path | None, *, spread: bool) -> list[Sample]:
    """At most PICTURES photographs of the training side, sorted by path; or those that a file lists, one path a line.

    samples: of both sides. spread: taken evenly from the sorted ones; else the first.
    Raises UserError where a listed picture is unknown, or is held out, or of a sequence that is.
    """
    photographs = sorted((s for s in samples if s.source.name != RENDERED), key=lambda s: str(s.picture))
    if listed is None:
        chosen = [sample for sample in photographs if not sample.held_out]
        chosen = list({sample.picture: sample for sample in chosen}.values())
        step = max(1, len(chosen) // CALIBRATION_PICTURES) if spread else 1
        chosen = chosen[::step][:CALIBRATION_PICTURES]
    else:
        chosen = _read_listed_samples(listed, samples)
    if not chosen:
        raise UserError("calibration: no training picture")
    refuse_held_out(chosen, samples)
    return chosen


def refuse_held_out(chosen: Sequence[Sample], samples: Sequence[Sample]) -> None:
    """Raises UserError naming a picture that is held out, or of a sequence that is (T6)."""
    pictures = {sample.picture for sample in samples if sample.held_out}
    sequences = {(sample.source.name, sample.sequence) for sample in samples if sample.held_out}
    for sample in chosen:
        if sample.picture in pictures or (sample.source.name, sample.sequence) in sequences:
            raise UserError(f"{sample.picture}: is held out; a net calibrated on it cannot be judged on it")


def hash_sample_names(chosen: Sequence[Sample]) -> str:
    """Hexadecimal SHA-256 of the pictures' names, for the record."""
    names = "\n".join(f"{sample.source.name}/{sample.picture.name}" for sample in chosen)
    return hashlib.sha256(names.encode()).hexdigest()


def _read_listed_samples(path: Path, samples: Sequence[Sample]) -> list[Sample]:
    known = {str(sample.picture.resolve()): sample for sample in samples}
    try:
        lines = [line.strip() for line in path.read_text(encoding="utf-8").splitlines() if line.strip()]
        places = [str(Path(line).resolve()) for line in lines]
    except (OSError, ValueError, RuntimeError) as error:  # a name with a null byte, a link that leads to itself
        raise UserError(f"{path}: {error}") from error
    for line, place in zip(lines, places, strict=True):
        if place not in known:
            raise UserError(f"{path}: {line}: not a picture of the chosen sources")
    return [known[place] for place in places]
