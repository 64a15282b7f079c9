"""Computes the decisions of one service again from what its steps had been given. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from enum import StrEnum
from types import MappingProxyType
from typing import Any, NamedTuple

import msgspec

from paani import messages as m
from paani.config import Config
from paani.decider import Decider
from paani.logs.reader import Record
from paani.undecodable import UNDECODABLE
from paani_tools.replay.difference import Schema, as_recorded
from paani_tools.replay.ledger import LATE_US, NO_PAYLOADS, Ledger, MessageId, RecordedStep


class SkipReason(StrEnum):
    """Why a step cannot be computed again."""

    BEFORE_STATE = "before the first state in the log"
    AFTER_BREAK = "no state since a break"
    STATE_UNREADABLE = "its state does not decode"
    LACKS_INPUT = "a message it had heard is not in the log"
    FAILED = "the decider failed"


class ExpectedGap(StrEnum):
    """Why it is right that a step cannot be computed again."""

    START = "the log begins later than what it needs"
    LOST = "what it needs was lost, as the recorder says"


class RecordingFacts(NamedTuple):
    """What recordings say of themselves.

    lost: messages of each topic that the recorder has counted as lost. recordings: when each began and ended [us].
    schemas: of the messages of each topic, which tell a field that was not set from one that was not known yet.
    """

    lost: Mapping[str, int]
    recordings: tuple[tuple[int, int], ...]
    schemas: Mapping[str, Schema] = MappingProxyType({})

    def at_edge(self, log_us: int) -> bool:
        """Whether a recording began or ended about then, so that what belongs together may not be in it together."""
        return any(
            0 <= log_us - start_us <= LATE_US or 0 <= end_us - log_us <= LATE_US for start_us, end_us in self.recordings
        )


class RecomputedStep(NamedTuple):
    """One step, computed again: what each sent message was, and what it is now; or why it is not.

    state_same: whether the state before it is the recorded one; None where none is recorded.
    missing_before: steps just before it that are not in the log, without excuse.
    """

    given: RecordedStep
    outputs: tuple[tuple[m.OutputMessage, bytes | None, bytes], ...] = ()
    skip: SkipReason | None = None
    detail: str = ""
    excuse: ExpectedGap | None = None
    state_same: bool | None = None
    missing_before: int = 0


class Recomputation:
    """`steps` goes through the records once.

    evolve: settings are changed, so a recorded state is only taken up at the start and after a break.
    facts: what the recording says of its gaps. instead: as for `Ledger`. lost_steps: steps it has counted as lost.
    """

    def __init__(
        self,
        decider: Decider[Any],
        config: Config,
        facts: RecordingFacts,
        *,
        evolve: bool,
        instead: Mapping[MessageId, bytes] = NO_PAYLOADS,
    ) -> None:
        self.ledger = Ledger(decider, instead)
        self._decider, self._config, self._evolve = decider, config, evolve
        self._outputs = {topic.name: topic for topic in decider.outputs}
        self._encoder = msgspec.json.Encoder()
        self._states = msgspec.json.Decoder(type(decider.state()))
        self._state: Any = None
        self._reason = SkipReason.BEFORE_STATE
        self._excuse: ExpectedGap | None = ExpectedGap.START
        self._last: m.Step | None = None
        self._lost = dict(facts.lost)
        self._facts = facts
        self._last_us = 0
        self.lost_steps = 0

    def steps(self, records: Iterable[Record]) -> Iterator[RecomputedStep]:
        """Every step that the log has, in order."""
        for given in self.ledger.steps(records):
            last, step = self._last, given.step
            if last is not None and (step.epoch, step.seq) <= (last.epoch, last.seq):
                continue  # the same twice
            self._last, last_us, self._last_us = step, self._last_us, given.log_us
            missing = 0
            if last is not None:
                begun = any(last_us < start_us <= given.log_us for start_us, _ in self._facts.recordings)
                same = step.epoch == last.epoch
                missing = step.seq - (last.seq + 1 if same else 0)
                excuse = ExpectedGap.START if begun else None
                if missing and not begun and self.is_lost(self.ledger.step_topic, missing):
                    excuse, self.lost_steps = ExpectedGap.LOST, self.lost_steps + missing
                if not same:  # the process began again
                    self._state, self._reason, self._excuse = None, SkipReason.AFTER_BREAK, excuse
                elif missing:
                    self._lose(SkipReason.AFTER_BREAK, excuse)
                missing = missing if excuse is None else 0
            yield self._recompute(given)._replace(missing_before=missing)

    @property
    def state(self) -> Any:
        """After the step before; None where it is not known."""
        return self._state

    def is_lost(self, topic: str, count: int = 1) -> bool:
        """Whether the recorder has counted as many more messages of a topic as lost."""
        if self._lost.get(topic, 0) < count:
            return False
        self._lost[topic] = self._lost.get(topic, 0) - count
        return True

    def _recompute(self, given: RecordedStep) -> RecomputedStep:
        step, same, schemas = given.step, None, self._facts.schemas
        if step.state:
            try:
                recorded = self._states.decode(step.state)
            except UNDECODABLE as error:
                self._lose(SkipReason.STATE_UNREADABLE, None)
                return RecomputedStep(given, skip=SkipReason.STATE_UNREADABLE, detail=str(error))
            if self._state is not None and not self._evolve:
                state = step.state.encode()
                same = as_recorded(self._encoder.encode(self._state), state) == state
            if self._state is None or not self._evolve:
                self._state = recorded
        if self._state is None:
            return RecomputedStep(given, skip=self._reason, excuse=self._excuse)
        if given.inputs is None:
            excuse = ExpectedGap.START if given.early or self._facts.at_edge(given.log_us) else None
            if given.absent and excuse is None and all(map(self.is_lost, given.absent)):
                excuse = ExpectedGap.LOST
            self._lose(SkipReason.AFTER_BREAK, excuse)
            return RecomputedStep(given, skip=SkipReason.LACKS_INPUT, detail=given.lacks, excuse=excuse)
        try:
            self._state, outputs = self._decider.decide(self._state, given.inputs, step.source_us, self._config)
            compared = tuple(
                (
                    sent,
                    recorded,
                    as_recorded(self._encoded(sent, outputs[sent.topic]), recorded, schemas.get(sent.topic)),
                )
                for sent, recorded in given.sent
            )
        except Exception as error:  # noqa: BLE001  # a log may hold what no live process could have been given
            self._lose(SkipReason.AFTER_BREAK, None)
            return RecomputedStep(given, skip=SkipReason.FAILED, detail=f"{type(error).__name__}: {error}")
        return RecomputedStep(given, compared, state_same=same)

    def _encoded(self, sent: m.OutputMessage, message: m.Message) -> bytes:
        """As the bus would have sent it, with the header that the step has kept."""
        return self._encoder.encode(
            self._outputs[sent.topic].stamp(
                message,
                domain=self._config.bus.domain,
                seq=sent.seq,
                epoch=sent.epoch,
                sent_us=sent.sent_us,
                steady_us=sent.steady_us,
            )
        )

    def _lose(self, reason: SkipReason, excuse: ExpectedGap | None) -> None:
        """The state is not known any more, until the next one recorded."""
        self._state, self._reason, self._excuse = None, reason, excuse
