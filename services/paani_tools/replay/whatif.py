"""What other settings would have decided: the changed decisions of one service, in episodes. Pure."""

from __future__ import annotations

import collections
from collections.abc import Iterable
from typing import Any

import msgspec

from paani.config import Config
from paani.decider import Decider
from paani.logs.reader import Record
from paani_tools.replay.check import StepCallback
from paani_tools.replay.decision_text import decision_text, reason_text
from paani_tools.replay.difference import differing_fields
from paani_tools.replay.ledger import MessageId
from paani_tools.replay.recompute import Losses, Recomputation

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
    losses: Losses,
    instead: dict[MessageId, bytes],
    on_step: StepCallback | None = None,
) -> ServiceChanges:
    """Decide everything again with `config`, on the recorded inputs; the state evolves from the first one recorded,
    and from the next one after a break.

    instead: inputs given in place of the recorded ones; what is sent and differs is added to it.
    """
    decoders = {topic.name: msgspec.json.Decoder(topic.type) for topic in decider.outputs}
    open_episodes: dict[str, Episode] = {}
    episodes: list[Episode] = []
    fields: collections.Counter[str] = collections.Counter()
    messages = changed = numbers = skipped = 0
    for step in Recomputation(decider, config, losses, evolve=True, instead=instead).steps(records):
        if on_step is not None:
            on_step(step)
        skipped += step.skip is not None
        at_s = (step.given.step.source_us - start_us) * 1e-6
        for sent, recorded, computed in step.outputs:
            if recorded is None:
                continue
            messages += 1
            if recorded == computed:
                continue
            instead[sent.topic, sent.epoch, sent.seq] = computed
            try:
                before, now = decoders[sent.topic].decode(recorded), decoders[sent.topic].decode(computed)
            except msgspec.MsgspecError:
                skipped += 1
                continue
            if decision_text(before) == decision_text(now):
                numbers += 1
                fields.update(path.partition("[")[0] for path, _, _ in differing_fields(recorded, computed))
                continue
            changed += 1
            episode = open_episodes.get(sent.topic)
            same = episode is not None and (episode.recorded, episode.computed) == (
                decision_text(before),
                decision_text(now),
            )
            if episode is not None and same and at_s - episode.end_s <= GAP_US * 1e-6:
                episode.end_s, episode.decisions = at_s, episode.decisions + 1
                continue
            open_episodes[sent.topic] = Episode(
                topic=sent.topic,
                start_s=at_s,
                end_s=at_s,
                decisions=1,
                recorded=decision_text(before),
                computed=decision_text(now),
                recorded_why=reason_text(before),
                computed_why=reason_text(now),
            )
            episodes.append(open_episodes[sent.topic])
    return ServiceChanges(
        service=decider.service,
        messages=messages,
        changed=changed,
        numbers=numbers,
        skipped=skipped,
        fields=tuple(fields.most_common(SHOWN_FIELDS)),
        episodes=tuple(episodes),
    )
