"""Every decision of a log computed again: as it was, or with other settings."""

from __future__ import annotations

import collections
import hashlib
from typing import Any

import msgspec

from paani import keys
from paani.clock import stopwatch_ms
from paani.config import Config, with_settings
from paani.decider import Decider, deciders
from paani.logs.reader import Log
from paani.undecodable import UNDECODABLE
from paani_tools.progress import Progress
from paani_tools.replay.check import ServiceCheck, StepCallback, check_service
from paani_tools.replay.difference import Schema
from paani_tools.replay.ledger import Ledger, MessageId
from paani_tools.replay.recompute import RecomputedStep, RecordingFacts
from paani_tools.replay.whatif import ServiceChanges, changes_of


class CheckReport(msgspec.Struct, frozen=True, kw_only=True):
    """A whole log. digest: SHA-256 over the digests of the services, in their order."""

    path: str
    log_s: float
    took_s: float
    services: tuple[ServiceCheck, ...]
    not_installed: tuple[str, ...]
    problems: tuple[str, ...]
    notes: tuple[str, ...]
    digest: str

    @property
    def decisions(self) -> int:
        return sum(service.decisions for service in self.services)

    @property
    def differ(self) -> int:
        return sum(service.differ for service in self.services)

    @property
    def is_exact(self) -> bool:
        """Every service whose steps are in the log is exact, there is at least one, and the log was read whole."""
        return (
            bool(self.services) and all(s.is_exact for s in self.services) and not (self.not_installed or self.problems)
        )


class ChangeReport(msgspec.Struct, frozen=True, kw_only=True):
    """What other settings would have decided. chained: recomputed outputs were given to the services after."""

    path: str
    sets: tuple[str, ...]
    chained: bool
    log_s: float
    took_s: float
    services: tuple[ServiceChanges, ...]
    problems: tuple[str, ...]
    notes: tuple[str, ...]


def check_log(log: Log, config: Config, notes: tuple[str, ...] = ()) -> CheckReport:
    """Compute every service's decisions again. Steps of services that are not installed are named."""
    began_ms = stopwatch_ms()
    facts = recording_facts(log)
    chosen = _installed(log)
    with Progress("checking") as progress:
        checks = tuple(
            check_service(
                decider,
                config,
                log.records(Ledger(decider).topics),
                facts,
                _progress_callback(progress, log, decider.service, number, len(chosen)),
            )
            for number, decider in enumerate(chosen)
        )
    return CheckReport(
        path=str(log.path),
        log_s=(log.end_us - log.start_us) * 1e-6,
        took_s=(stopwatch_ms() - began_ms) * 1e-3,
        services=checks,
        not_installed=tuple(sorted({*services_in(log)} - {decider.service for decider in chosen})),
        problems=tuple(log.problems),
        notes=notes,
        digest=hashlib.sha256("".join(check.digest for check in checks).encode()).hexdigest(),
    )


def change_log(
    log: Log, config: Config, sets: tuple[str, ...], notes: tuple[str, ...], *, chained: bool
) -> ChangeReport:
    """Decide everything again with changed settings. Raises UserError for a setting that is wrong."""
    began_ms = stopwatch_ms()
    changed, facts = with_settings(config, sets), recording_facts(log)
    chosen = _installed(log)
    instead: dict[MessageId, bytes] = {}
    with Progress("deciding") as progress:
        services = tuple(
            changes_of(
                decider,
                changed,
                log.records(Ledger(decider).topics),
                log.start_us,
                facts,
                instead if chained else {},
                _progress_callback(progress, log, decider.service, number, len(chosen)),
            )
            for number, decider in enumerate(chosen)
        )
    return ChangeReport(
        path=str(log.path),
        sets=sets,
        chained=chained,
        log_s=(log.end_us - log.start_us) * 1e-6,
        took_s=(stopwatch_ms() - began_ms) * 1e-3,
        services=services,
        problems=tuple(log.problems),
        notes=notes,
    )


def _installed(log: Log) -> list[Decider[Any]]:
    """Deciders of the services that left steps in the log, in the order of the chain."""
    found, installed = services_in(log), deciders()
    return [installed[name] for name in keys.STEPS if name in found and name in installed]


def _progress_callback(progress: Progress, log: Log, service: str, number: int, total: int) -> StepCallback:
    def show(step: RecomputedStep) -> None:
        done = (step.given.log_us - log.start_us) / max(1, log.end_us - log.start_us)
        progress.at((number + done) / total, service)

    return show


def services_in(log: Log) -> set[str]:
    """Services that left steps in the log."""
    suffix = "/step"
    return {topic.removesuffix(suffix) for topic in log.topics if topic.endswith(suffix)}


def recording_facts(log: Log) -> RecordingFacts:
    """What the recording says of itself; lost is what was dropped or missing, in all parts together."""
    lost = collections.Counter(log.recorder_counts("dropped")) + collections.Counter(log.recorder_counts("missing"))
    return RecordingFacts(lost, log.recordings, {topic: _schema_of(log, topic) for topic in log.topics})


def _schema_of(log: Log, topic: str) -> Schema:
    """What the recording says of a topic's messages; nothing where that is none of ours."""
    try:
        return msgspec.json.decode(log.schema(topic) or b"{}", type=dict[str, Any])
    except UNDECODABLE:
        return {}
