"""Annotated pictures in batches, so that a network is scored on them by one process or by the workers of a cluster."""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from tqdm import tqdm

from paani.cluster import InProcess, Workers
from paani.errors import UserError
from paani_models.datasets.sources import Sample

BATCH_PICTURES = 32  # some seconds of work, beside which it costs little to open the network
R = TypeVar("R")


@dataclass(frozen=True)
class Batch:
    """One piece of work: pictures, and the network file with the SHA-256 that it has where the work was asked for."""

    net: Path
    sha256: str
    samples: tuple[Sample, ...]


def score_batches(
    score: Callable[[Batch], list[R]], net: Path, samples: Sequence[Sample], workers: Workers | None, what: str
) -> list[R]:
    """Score every sample, in their order. score: of a module, gives one result per sample. workers: who
    does; this process if not given.

    Raises UserError naming a file that cannot be read, or that is another where a worker reads it.
    """
    sha256 = _file_sha256(net)
    batches = [
        Batch(net.absolute(), sha256, tuple(samples[first : first + BATCH_PICTURES]))
        for first in range(0, len(samples), BATCH_PICTURES)
    ]
    results: dict[int, list[R]] = {}
    with (
        tqdm(total=len(samples), desc=what, unit="picture", mininterval=2.0) as progress,
        contextlib.closing((workers or InProcess()).run(score, batches, results.__setitem__)) as done,
    ):
        for index in done:
            progress.update(len(batches[index].samples))
    return [result for index in range(len(batches)) for result in results[index]]


def network_of(batch: Batch) -> Path:
    """The batch's network. Raises UserError where the file is not the one that was asked for."""
    if _file_sha256(batch.net) != batch.sha256:
        raise UserError(f"{batch.net}: not the file that it is where the work was asked for")
    return batch.net


def _file_sha256(path: Path) -> str:
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        raise UserError(f"{path}: {error.strerror}") from error
