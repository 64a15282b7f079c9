"""Record of experiments: earlier weights, the recipe of each, and what they reached of the required figures."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import msgspec

from paani.errors import UserError
from paani.undecodable import UNREADABLE
from paani.whole_file import indented_json
from paani_models.catalogue import Figure, Model, Record
from paani_models.report.requirements import RequirementResult

EXPERIMENTS = "experiments.json"
PRESENT_WEIGHTS = "these weights"


class Experiment(Record, frozen=True):
    """One recipe in words, and what it reached on held-out sequences of real pictures.

    sha256: of the file that was measured. inference: how it was run, where otherwise than on the board.
    """

    net: str
    sha256: str
    recipe: str
    figures: tuple[Figure, ...]
    inference: str = ""

    def value(self, metric: str, source: str, n: int) -> float | None:
        """One of its figures; None where it has none of that name, or one of other pictures than n of them."""
        return next((f.value for f in self.figures if (f.metric, f.source, f.n) == (metric, source, n)), None)


class _Record(Record, frozen=True):
    experiments: tuple[Experiment, ...]


def read_experiments(weights: Path) -> tuple[Experiment, ...]:
    """Read the record of a weights folder, oldest first, empty where there is none.

    Raises UserError naming a malformed one.
    """
    path = weights / EXPERIMENTS
    if not path.is_file():
        return ()
    try:
        return msgspec.json.decode(path.read_bytes(), type=_Record).experiments
    except UNREADABLE as error:
        raise UserError(f"{path}: {error}") from error


def with_present_weights(
    experiments: Sequence[Experiment], catalogue: dict[str, Model], results: Sequence[RequirementResult]
) -> tuple[Experiment, ...]:
    """Put the present weights, as measured now, into the record: in their place, or as its last row."""
    rows = list(experiments)
    for net in dict.fromkeys(each.requirement.net for each in results):
        figures = tuple(
            Figure(each.requirement.metric, each.requirement.source, round(each.value, 4), each.n)
            for each in results
            if each.requirement.net == net
        )
        sha256 = catalogue[net].sha256
        place = next((i for i, row in enumerate(rows) if row.sha256 == sha256 and not row.inference), None)
        if place is None:
            rows.append(Experiment(net, sha256, PRESENT_WEIGHTS, figures))
        else:
            rows[place] = msgspec.structs.replace(rows[place], figures=figures)
    return tuple(rows)


def encode_experiments(experiments: Sequence[Experiment]) -> bytes:
    """Encode the record as it is stored beside a manifest."""
    return indented_json(_Record(tuple(experiments)))
