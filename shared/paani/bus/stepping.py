"""Runs a decider on a bus, live or in lockstep, and keeps the ledger of its steps."""

from __future__ import annotations

from typing import Any, Generic, Protocol, TypeVar

import msgspec

from paani import keys
from paani import messages as m
from paani.clock import Clock, has_passed
from paani.config import Config
from paani.decider import Decider, Input, Outputs

STATE_EVERY_US = 2_000_000  # a message lost on the way to the recorder costs a replay no more steps than this


class NewestMessage(Protocol):
    """An inbox of depth one."""

    @property
    def newest(self) -> Input:
        """The newest message and when it was received."""
        ...


class MessagePublisher(Protocol):
    """The right to write one topic."""

    def put(self, message: Any) -> Any:
        """Fill in the header and publish; returns the message as sent."""
        ...


S = TypeVar("S")
I = TypeVar("I", bound=NewestMessage)  # noqa: E741  # the inbox of the bus in use
I_co = TypeVar("I_co", bound=NewestMessage, covariant=True)


class StepperBus(Protocol[I_co]):
    """What a decider's steps need of a bus: the live `Bus`, or the lockstep bus of a trial."""

    def latest(self, topic: keys.Topic[Any]) -> I_co:
        """Subscribe, newest wins."""
        ...

    def publisher(self, topic: keys.Topic[Any]) -> MessagePublisher:
        """Write one topic."""
        ...


class Stepper(Generic[S, I]):
    """`decide` calls the decider with the newest of every input; `conclude` publishes and writes the step."""

    def __init__(self, bus: StepperBus[I], clock: Clock, config: Config, decider: Decider[S]) -> None:
        self._clock, self._config, self._decider = clock, config, decider
        self.inboxes: dict[str, I] = {topic.name: bus.latest(topic) for topic in decider.inputs}
        self._publishers = {topic.name: bus.publisher(topic) for topic in (*decider.outputs, *decider.own)}
        self._steps = bus.publisher(keys.STEPS[decider.service])
        self._own: dict[str, Input] = {}
        self.state = decider.state()
        self._before, self._inputs, self._now_us = self.state, dict[str, Input](), 0
        self._state_us = 0

    def publish_own(self, topic: keys.Topic[Any], message: m.Message) -> None:
        """Publish a message of this process that its own steps need."""
        self._own[topic.name] = Input(self._publishers[topic.name].put(message))

    def decide(self) -> tuple[int, Outputs]:
        """One step of the state: the time it was given [us], and what it says. `conclude` must follow."""
        self._now_us = self._clock.now_us()
        self._inputs = {name: inbox.newest for name, inbox in self.inboxes.items()} | self._own
        self._before = self.state
        self.state, outputs = self._decider.decide(self.state, self._inputs, self._now_us, self._config)
        return self._now_us, outputs

    def conclude(self, outputs: Outputs) -> dict[str, m.Message]:
        """Publish what is to be published of the last step, and the step itself; returns messages as sent."""
        sent = {name: self._publishers[name].put(message) for name, message in outputs.items()}
        state = ""
        if has_passed(self._state_us, STATE_EVERY_US, self._now_us):
            state, self._state_us = msgspec.json.encode(self._before).decode(), self._now_us
        self._steps.put(
            m.Step(
                source_us=self._now_us,
                heard=tuple(
                    m.InputMessage(
                        topic=name,
                        epoch=given.message.epoch,
                        seq=given.message.seq,
                        received_us=given.received_us,
                        source_us=given.message.source_us if given.message.steady_us else 0,
                    )
                    for name, given in self._inputs.items()
                    if given.message is not None
                ),
                sent=tuple(
                    m.OutputMessage(
                        topic=name,
                        epoch=message.epoch,
                        seq=message.seq,
                        sent_us=message.sent_us,
                        steady_us=message.steady_us,
                    )
                    for name, message in sent.items()
                ),
                state=state,
            )
        )
        return sent
