"""What other settings would have decided: the changed decisions of one service, in episodes. Pure."""

from __future__ import annotations

import collections
from collections.abc import Iterable
from typing import Any

import msgspec

from paani import messages as m
from paani.config import Config
from paani.decider import Decider
from paani.logs.reader import Record
from paani.undecodable import UNDECODABLE
from paani_tools.replay.check import StepCallback
from paani_tools.replay.decision_text import decision_text, reason_text
from paani_tools.replay.difference import differing_fields
from paani_tools.replay.ledger import MessageId
from paani_tools.replay.recompute import Recomputation, RecordingFacts

GAP_US = 1_000_000  # changed decisions further apart are two episodes
SHOWN_FIELDS = 6


class Episode(msgspec.Struct, kw_only=True):
    """Decisions in a row that changed in the same way. Times since the log's start; reasons of the first."""

    topic: str
    start_s: float
    end_s: float
    decisions: int
    recorded: str
    computed: str
    recorded_why: str
    computed_why: str


class ServiceChanges(msgspec.Struct, frozen=True, kw_only=True):
    """One service. changed: messages that say something else; numbers: those that differ in other fields only."""

    service: str
    messages: int
    changed: int
    numbers: int
    skipped: int
    fields: tuple[tuple[str, int], ...]
    episodes: tuple[Episode, ...]


def changes_of(
    decider: Decider[Any],
    config: Config,
    records: Iterable[Record],
    start_us: int,
    facts: RecordingFacts,
    instead: dict[MessageId, bytes],
    on_step: StepCallback | None = None,
) -> ServiceChanges:
    """Decide everything again with `config`, on the recorded inputs; the state evolves from the first one recorded,
    and from the next one after a break.

    instead: inputs given in place of the recorded ones; what is sent and differs is added to it.
    """
    changes = _Changes(decider, start_us)
    for step in Recomputation(decider, config, facts, evolve=True, instead=instead).steps(records):
        if on_step is not None:
            on_step(step)
        changes.skipped += step.skip is not None
        for sent, recorded, computed in step.outputs:
            if recorded is None:
                continue
            changes.messages += 1
            if recorded != computed:
                instead[sent.topic, sent.epoch, sent.seq] = computed
                changes.take(sent.topic, step.given.step.source_us, recorded, computed)
    return changes.result()


class _Changes:
    """Counts messages of one service that differ, and joins changed decisions into episodes."""

    def __init__(self, decider: Decider[Any], start_us: int) -> None:
        self.messages = self.skipped = 0
        self._changed = self._numbers = 0
        self._service, self._start_us = decider.service, start_us
        self._decoders = {topic.name: msgspec.json.Decoder(topic.type) for topic in decider.outputs}
        self._fields: collections.Counter[str] = collections.Counter()
        self._episodes: list[Episode] = []
        self._newest: dict[str, Episode] = {}

    def take(self, topic: str, at_us: int, recorded: bytes, computed: bytes) -> None:
        """A message that is not byte for byte the same."""
        decode = self._decoders[topic].decode
        try:
            before, now = decode(recorded), decode(computed)
        except UNDECODABLE:
            self.skipped += 1
            return
        if decision_text(before) == decision_text(now):
            self._numbers += 1
            self._fields.update(path.partition("[")[0] for path, _, _ in differing_fields(recorded, computed))
            return
        self._changed += 1
        self._join_episode(topic, (at_us - self._start_us) * 1e-6, before, now)

    def _join_episode(self, topic: str, at_s: float, before: m.Message, now: m.Message) -> None:
        """Go on with the topic's newest episode if the same changed in it a moment ago, else begin one."""
        texts = decision_text(before), decision_text(now)
        newest = self._newest.get(topic)
        if newest and (newest.recorded, newest.computed) == texts and at_s - newest.end_s <= GAP_US * 1e-6:
            newest.end_s, newest.decisions = at_s, newest.decisions + 1
            return
        self._newest[topic] = Episode(
            topic=topic,
            start_s=at_s,
            end_s=at_s,
            decisions=1,
            recorded=texts[0],
            computed=texts[1],
            recorded_why=reason_text(before),
            computed_why=reason_text(now),
        )
        self._episodes.append(self._newest[topic])

    def result(self) -> ServiceChanges:
        """Everything so far."""
        return ServiceChanges(
            service=self._service,
            messages=self.messages,
            changed=self._changed,
            numbers=self._numbers,
            skipped=self.skipped,
            fields=tuple(self._fields.most_common(SHOWN_FIELDS)),
            episodes=tuple(self._episodes),
        )
