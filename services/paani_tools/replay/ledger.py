"""Steps of one service as a log has them, each with the messages it was given and those it sent. Pure.

Memory is bounded: messages are kept for a minute, and what a step had heard for as long as the next may hear it.
"""

from __future__ import annotations

import collections
import types
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, NamedTuple

import msgspec

from paani import keys
from paani import messages as m
from paani.decider import Decider, Input
from paani.logs.reader import Record
from paani.undecodable import UNDECODABLE

KEEP_US = 60_000_000
FORGET_EVERY_US = 1_000_000
LATE_US = 3_000_000  # messages of one moment reach the recorder in any order within this

MessageId = tuple[str, int, int]  # topic, epoch, seq
NO_PAYLOADS: Mapping[MessageId, bytes] = types.MappingProxyType({})


class RecordedStep(NamedTuple):
    """One step. `inputs` is None where `lacks` says why.

    absent: topics of the messages that it had heard and the log has not, but for those sent before the log began;
    early: there are only such.
    sent: what the step sent, with the recorded payload; None where the log has none.
    """

    log_us: int
    step: m.Step
    inputs: dict[str, Input] | None
    lacks: str
    absent: tuple[str, ...]
    early: bool
    sent: tuple[tuple[m.OutputMessage, bytes | None], ...]


class _Head(msgspec.Struct):
    epoch: int
    seq: int


class _StoredMessage:
    __slots__ = ("claimed", "data", "log_us")

    def __init__(self, data: bytes, log_us: int) -> None:
        self.data, self.log_us, self.claimed = data, log_us, False


class Ledger:
    """`steps` goes once through the records of `topics`; the other attributes are complete after it.

    instead: payloads to give to steps in place of the recorded ones.
    orphans: outputs that no step names, and when they came, between the first and the last that one does.
    malformed: messages without a readable header, by topic.
    """

    def __init__(self, decider: Decider[Any], instead: Mapping[MessageId, bytes] = NO_PAYLOADS) -> None:
        self._instead = instead
        self.step_topic = keys.STEPS[decider.service].name
        message_id = (*decider.inputs, *decider.own)
        self._decoders = {topic.name: msgspec.json.Decoder(topic.type) for topic in message_id}
        self._empty = {topic.name: Input() for topic in decider.inputs}
        self._outputs = {topic.name for topic in decider.outputs}
        self.topics = frozenset((self.step_topic, *self._decoders, *self._outputs))
        self.orphans: list[tuple[int, MessageId]] = []
        self.malformed: collections.Counter[str] = collections.Counter()
        self._messages: dict[MessageId, _StoredMessage] = {}
        self._order: collections.deque[MessageId] = collections.deque()
        self._forget_us = 0
        self._newest_heard: dict[str, tuple[int, int, Any]] = {}
        self._first: dict[str, dict[int, int]] = {}  # topic: epoch: first seq recorded
        self._claimed: dict[tuple[str, int], tuple[int, int]] = {}  # (topic, epoch): lowest and highest seq
        self._unclaimed: list[tuple[int, MessageId]] = []

    def steps(self, records: Iterable[Record]) -> Iterator[RecordedStep]:
        """Every step in the order recorded, each a few seconds of log later than it came."""
        waiting: collections.deque[tuple[int, m.Step]] = collections.deque()
        head, step_decoder = msgspec.json.Decoder(_Head), msgspec.json.Decoder(m.Step)
        for record in records:
            topic, log_us, _, data = record
            try:
                if topic == self.step_topic:
                    waiting.append((log_us, step_decoder.decode(data)))
                else:
                    name = head.decode(data)
                    self._keep((topic, name.epoch, name.seq), _StoredMessage(data, log_us))
            except UNDECODABLE:
                self.malformed[topic] += 1
            while waiting and waiting[0][0] + LATE_US <= log_us:
                yield self._recorded_step(*waiting.popleft())
            if log_us >= self._forget_us:
                self._forget(log_us - KEEP_US)
                self._forget_us = log_us + FORGET_EVERY_US
        while waiting:
            yield self._recorded_step(*waiting.popleft())
        self._forget(None)
        self.orphans = [(at_us, name) for at_us, name in self._unclaimed if self._is_between(name)]

    def precedes(self, topic: str, epoch: int, seq: int) -> bool:
        """Whether a message was sent before the first one that the recorder got from its publisher."""
        first = self._first.get(topic, {})
        return seq < first[epoch] if epoch in first else bool(first) and epoch < min(first)

    def _recorded_step(self, log_us: int, step: m.Step) -> RecordedStep:
        sent = []
        for message in step.sent:
            held = self._messages.get((message.topic, message.epoch, message.seq))
            if held is not None:
                held.claimed = True
            low, high = self._claimed.get((message.topic, message.epoch), (message.seq, message.seq))
            self._claimed[message.topic, message.epoch] = min(low, message.seq), max(high, message.seq)
            sent.append((message, None if held is None else held.data))
        inputs = dict(self._empty)
        lacks, absent, undecodable = "", [], False
        for message_id in step.heard:
            if message_id.topic not in self._decoders:
                continue  # of a version whose decider heard more
            message, lack = self._message(message_id)
            if not lack:
                inputs[message_id.topic] = Input(message, message_id.received_us)
                continue
            lacks = lacks or lack
            if (message_id.topic, message_id.epoch, message_id.seq) in self._messages:
                undecodable = True
            elif not self.precedes(message_id.topic, message_id.epoch, message_id.seq):
                absent.append(message_id.topic)
        early = bool(lacks) and not absent and not undecodable
        return RecordedStep(
            log_us, step, None if lacks else inputs, lacks, () if undecodable else tuple(absent), early, tuple(sent)
        )

    def _message(self, message_id: m.InputMessage) -> tuple[Any, str]:
        """The message that was heard, or why there is none."""
        last = self._newest_heard.get(message_id.topic)
        if last is not None and last[:2] == (message_id.epoch, message_id.seq):
            return last[2], ""
        name = message_id.topic, message_id.epoch, message_id.seq
        held = self._messages.get(name)
        if held is None:
            return None, f"{message_id.topic} it had heard is not in the log"
        try:
            message = self._decoders[message_id.topic].decode(self._instead.get(name, held.data))
        except UNDECODABLE as error:
            return None, f"{message_id.topic} it had heard does not decode: {error}"
        if message_id.source_us:
            message = msgspec.structs.replace(message, source_us=message_id.source_us)
        self._newest_heard[message_id.topic] = message_id.epoch, message_id.seq, message
        return message, ""

    def _keep(self, name: MessageId, held: _StoredMessage) -> None:
        """Note a message; of two with one name the first counts."""
        if name in self._messages:
            return
        self._messages[name] = held
        self._order.append(name)
        topic, epoch, seq = name
        self._first.setdefault(topic, {}).setdefault(epoch, seq)

    def _forget(self, before_us: int | None) -> None:
        """Drop messages older than this (None: all), noting outputs that no step has named."""
        while self._order:
            name = self._order[0]
            held = self._messages[name]
            if before_us is not None and held.log_us >= before_us:
                return
            self._order.popleft()
            del self._messages[name]
            if name[0] in self._outputs and not held.claimed:
                self._unclaimed.append((held.log_us, name))

    def _is_between(self, name: MessageId) -> bool:
        topic, epoch, seq = name
        low, high = self._claimed.get((topic, epoch), (0, -1))
        return low < seq < high
