"""Compares decisions computed again with those recorded, and says whether anything is left unexplained. Pure."""

from __future__ import annotations

import collections
import hashlib
from collections.abc import Callable, Iterable
from typing import Any

import msgspec

from paani import messages as m
from paani.config import Config
from paani.decider import Decider
from paani.logs.reader import Record
from paani_tools.replay.difference import Difference, first_difference
from paani_tools.replay.recompute import ExpectedGap, Recomputation, RecomputedStep, RecordingFacts

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
    facts: RecordingFacts,
    on_step: StepCallback | None = None,
) -> ServiceCheck:
    """Compute every step of one service again and compare.

    records: those of `Ledger(decider).topics`. digest: SHA-256 of all bytes computed.
    """
    recompute = Recomputation(decider, config, facts, evolve=False)
    comparison = _Comparison(decider.service, recompute, facts)
    for step in recompute.steps(records):
        if on_step is not None:
            on_step(step)
        comparison.take_step(step)
    comparison.take_orphans()
    return comparison.finish()


class _Comparison:
    """What the steps of one service gave, beside what was recorded of them."""

    def __init__(self, service: str, recompute: Recomputation, facts: RecordingFacts) -> None:
        self._result = ServiceCheck(service=service)
        self._recompute, self._facts = recompute, facts
        self._causes: collections.Counter[str] = collections.Counter()
        self._differences: list[Difference] = []
        self._digest = hashlib.sha256()

    def take_step(self, step: RecomputedStep) -> None:
        """Count a step that was computed again, or why it could not be."""
        result = self._result
        result.steps += 1
        if step.missing_before:
            self._causes["steps are not in the log"] += step.missing_before
        if step.skip is not None:
            self._count_skipped(step, step.skip)
            return
        differs = step.state_same is False
        result.states += step.state_same is not None
        result.differing_states += differs
        for sent, recorded, computed in step.outputs:
            self._digest.update(computed)
            if recorded is None:
                self._count_unrecorded(sent, step.given.log_us)
                continue
            result.messages += 1
            result.message_bytes += len(recorded)
            if computed != recorded:
                differs = True
                result.differing_messages += 1
                if len(self._differences) < SHOWN:
                    self._differences.append(first_difference(step.given.step.source_us, sent, recorded, computed))
        result.decisions += bool(step.outputs) or differs
        result.differ += differs

    def _count_skipped(self, step: RecomputedStep, skip: str) -> None:
        if step.excuse is ExpectedGap.START:
            self._result.before_start += 1
        elif step.excuse is ExpectedGap.LOST:
            self._result.lost += 1
        else:
            self._causes[skip + (f" ({step.detail})" if step.detail else "")] += 1

    def _count_unrecorded(self, sent: m.OutputMessage, log_us: int) -> None:
        """A message that the step had sent and the log does not hold."""
        early = self._recompute.ledger.precedes(sent.topic, sent.epoch, sent.seq)
        if early or self._facts.at_edge(log_us):
            self._result.at_edges += 1
        elif self._recompute.is_lost(sent.topic):
            self._result.lost += 1
        else:
            self._causes[f"{sent.topic} it had sent is not in the log"] += 1

    def take_orphans(self) -> None:
        """Count, when all steps are through, the messages that belong to none and those that do not decode."""
        orphans: collections.Counter[str] = collections.Counter()
        for log_us, (topic, _, _) in self._recompute.ledger.orphans:
            orphans[topic] += 1
            if self._facts.at_edge(log_us):
                self._result.at_edges += 1
            elif orphans[topic] <= self._recompute.lost_steps:
                self._result.lost += 1
            else:
                self._causes[f"{topic} belongs to no step in the log"] += 1
        for topic, count in self._recompute.ledger.malformed.items():
            self._causes[f"{topic} does not decode"] += count

    def finish(self) -> ServiceCheck:
        """The counts, with the most frequent causes."""
        result = self._result
        result.unexplained = tuple(Unexplained(cause=cause, count=n) for cause, n in self._causes.most_common(SHOWN))
        result.differences = tuple(self._differences)
        result.digest = self._digest.hexdigest()
        return result
