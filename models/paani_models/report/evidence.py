"""Four classes of evidence that are never pooled (U7): a figure says which it is, and a mean refuses two."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from enum import StrEnum
from pathlib import Path

import msgspec

from paani.errors import UserError
from paani.undecodable import UNREADABLE


class Evidence(StrEnum):
    """What a figure was measured on."""

    LABELLED = "labelled_models"
    SCENARIOS = "offline_scenarios"
    TRAJECTORIES = "generated_trajectories"
    BOARD = "board_logs"


TITLES = {
    Evidence.LABELLED: "Models on labelled pictures",
    Evidence.SCENARIOS: "Offline scenarios",
    Evidence.TRAJECTORIES: "Generated trajectories",
    Evidence.BOARD: "Board logs",
}


class Finding(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One figure of one class of evidence; n counts what it was measured on, `of` names that."""

    evidence: Evidence
    metric: str
    source: str
    value: float
    n: int
    of: str = "pictures"


class Findings(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A file of findings: of one class."""

    evidence: Evidence
    findings: tuple[Finding, ...]


def pool_findings(findings: Sequence[Finding]) -> float:
    """Mean weighted by n of one metric. Raises ValueError for none, two metrics or two classes of evidence."""
    kinds = {(finding.evidence, finding.metric) for finding in findings}
    if len(kinds) != 1:
        raise ValueError(f"cannot pool {sorted(f'{evidence}/{metric}' for evidence, metric in kinds)}")
    total = sum(finding.n for finding in findings)
    return sum(finding.value * finding.n for finding in findings) / total


def group_by_evidence(findings: Iterable[Finding]) -> dict[Evidence, tuple[Finding, ...]]:
    """All four classes in order, empty where nothing was measured."""
    every = tuple(findings)
    return {kind: tuple(f for f in every if f.evidence is kind) for kind in Evidence}


def read_findings(path: Path) -> Findings:
    """Raises UserError naming a file that is missing or malformed, or holds another class than it declares."""
    try:
        findings = msgspec.json.decode(path.read_bytes(), type=Findings)
    except UNREADABLE as error:
        raise UserError(f"{path}: {error}") from error
    strange = next((f for f in findings.findings if f.evidence is not findings.evidence), None)
    if strange is not None:
        raise UserError(f"{path}: {strange.metric} is of {strange.evidence}, the file of {findings.evidence}")
    return findings
