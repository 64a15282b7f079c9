"""Compares decisions computed again with those recorded, and says whether anything is left unexplained. Pure."""

from __future__ import annotations

import collections
import hashlib
from collections.abc import Callable, Iterable
from typing import Any

import msgspec

from paani.config import Config
from paani.decider import Decider
from paani.logs.reader import Record
from paani_tools.replay.difference import Difference, first_difference
from paani_tools.replay.recompute import ExpectedGap, Losses, Recomputation, RecomputedStep

SHOWN = 20

StepCallback = Callable[[RecomputedStep], None]


class Unexplained(msgspec.Struct, frozen=True, kw_only=True):
    """What could not be checked though the log should allow it."""

    cause: str
    count: int


class ServiceCheck(msgspec.Struct, kw_only=True):
    """One service. A decision is a step that sent something and could be computed again.

    messages: sent messages compared, `differing_messages` of them not byte for byte the same. states: recorded states
    compared with the ones computed up to there. Explained are before_start: steps that the log's beginning leaves
    without state or input; at_edges: outputs without their step, or steps without their outputs, where a recording
    begins or ends; lost: the same where the recorder has counted losses.
    """

    service: str
    steps: int = 0
    decisions: int = 0
    differ: int = 0
    messages: int = 0
    differing_messages: int = 0
    message_bytes: int = 0
    states: int = 0
    differing_states: int = 0
    before_start: int = 0
    at_edges: int = 0
    lost: int = 0
    unexplained: tuple[Unexplained, ...] = ()
    differences: tuple[Difference, ...] = ()
    digest: str = ""

    @property
    def is_exact(self) -> bool:
        """Something was checked, it was all the same, and nothing is left unexplained."""
        return self.decisions > 0 and not self.differ and not self.unexplained


def check_service(
    decider: Decider[Any],
    config: Config,
    records: Iterable[Record],
    losses: Losses,
    on_step: StepCallback | None = None,
) -> ServiceCheck:
    """Compute every step of one service again and compare.

    records: those of `Ledger(decider).topics`. digest: SHA-256 of all bytes computed.
    """
    recompute = Recomputation(decider, config, losses, evolve=False)
    ledger = recompute.ledger
    result = ServiceCheck(service=decider.service)
    causes: collections.Counter[str] = collections.Counter()
    differences: list[Difference] = []
    digest = hashlib.sha256()
    for step in recompute.steps(records):
        result.steps += 1
        if on_step is not None:
            on_step(step)
        if step.missing_before:
            causes["steps are not in the log"] += step.missing_before
        if step.skip is not None:
            if step.excuse is ExpectedGap.START:
                result.before_start += 1
            elif step.excuse is ExpectedGap.LOST:
                result.lost += 1
            else:
                causes[step.skip + (f" ({step.detail})" if step.detail else "")] += 1
            continue
        differs = step.state_same is False
        result.states += step.state_same is not None
        result.differing_states += differs
        for sent, recorded, computed in step.outputs:
            digest.update(computed)
            if recorded is None:
                early = ledger.precedes(sent.topic, sent.epoch, sent.seq)
                if early or losses.at_edge(step.given.log_us):
                    result.at_edges += 1
                elif recompute.is_lost(sent.topic):
                    result.lost += 1
                else:
                    causes[f"{sent.topic} it had sent is not in the log"] += 1
                continue
            result.messages += 1
            result.message_bytes += len(recorded)
            if computed != recorded:
                differs = True
                result.differing_messages += 1
                if len(differences) < SHOWN:
                    differences.append(first_difference(step.given.step.source_us, sent, recorded, computed))
        result.decisions += bool(step.outputs) or differs
        result.differ += differs
    orphans: collections.Counter[str] = collections.Counter()
    for log_us, (topic, _, _) in ledger.orphans:
        orphans[topic] += 1
        if losses.at_edge(log_us):
            result.at_edges += 1
        elif orphans[topic] <= recompute.lost_steps:
            result.lost += 1
        else:
            causes[f"{topic} belongs to no step in the log"] += 1
    for topic, count in ledger.malformed.items():
        causes[f"{topic} does not decode"] += count
    result.unexplained = tuple(Unexplained(cause=cause, count=count) for cause, count in causes.most_common(SHOWN))
    result.differences = tuple(differences)
    result.digest = digest.hexdigest()
    return result
