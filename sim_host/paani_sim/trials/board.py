"""The board's deciding processes on a simulated clock, woken when their services wake.

Messages between them take no time; what perception takes is the drive's `perception_latency_s`.
"""

from __future__ import annotations

from typing import Any

import msgspec

from paani import keys
from paani import messages as m
from paani.bus.stepping import STATE_EVERY_US
from paani.config import Config
from paani.decider import Decider, Input, Outputs, decider_of
from paani_sim.trials.outbox import Outbox

SILENCE_PERIODS = 1.5  # the controller's, as live
WAKES_NAVIGATOR = frozenset(topic.name for topic in (keys.ADVISORY, keys.ODOMETRY, keys.ARMING))
AHEAD = m.Advisory(source_us=0, direction=m.Direction.STRAIGHT, reason=m.Reason.CENTER_CLEAR)


class Process:
    """One decider with the newest of every input, and the ledger of its steps where somebody records."""

    def __init__(self, service: str, config: Config, outbox: Outbox) -> None:
        self.decider: Decider[Any] = decider_of(service)
        self._config, self._outbox = config, outbox
        self._topics = {topic.name: topic for topic in (*self.decider.outputs, *self.decider.own)}
        self.inputs = {topic.name: Input() for topic in self.decider.inputs}
        self._own: dict[str, Input] = {}
        self.state = self._before = self.decider.state()
        self._given: dict[str, Input] = {}
        self._state_us = 0

    def publish_own(self, topic: keys.Topic[Any], message: m.Message, now_us: int) -> None:
        """A message of this process that its own steps need."""
        self._own[topic.name] = Input(self._outbox.put(topic, message, now_us))

    def decide(self, now_us: int) -> Outputs:
        """One step of the state; `conclude` must follow."""
        self._given = self.inputs | self._own
        self._before = self.state
        self.state, outputs = self.decider.decide(self.state, self._given, now_us, self._config)
        return outputs

    def conclude(self, outputs: Outputs, now_us: int) -> dict[str, m.Message]:
        """Publish what is to be published of the last step; returns messages as sent."""
        sent = {name: self._outbox.put(self._topics[name], message, now_us) for name, message in outputs.items()}
        if self._outbox.tap is not None:
            self._write_step(sent, now_us)
        return sent

    def _write_step(self, sent: dict[str, m.Message], now_us: int) -> None:
        state = ""
        if not self._state_us or now_us - self._state_us >= STATE_EVERY_US:
            state, self._state_us = msgspec.json.encode(self._before).decode(), now_us
        step = m.Step(
            source_us=now_us,
            heard=tuple(
                m.HeardMessage(topic=name, epoch=i.message.epoch, seq=i.message.seq, received_us=i.received_us)
                for name, i in self._given.items()
                if i.message is not None
            ),
            sent=tuple(
                m.SentMessage(topic=name, epoch=message.epoch, seq=message.seq, sent_us=message.sent_us)
                for name, message in sent.items()
            ),
            state=state,
        )
        self._outbox.put(keys.STEPS[self.decider.service], step, now_us)


class Board:
    """Advisor, navigator and controller. `blind`: no advisor; the advice is always to go straight on.

    mission: whose first leg follows a route.
    """

    def __init__(self, config: Config, mission: m.Mission, outbox: Outbox, *, blind: bool = False) -> None:
        self._config, self._mission, self._outbox = config, mission, outbox
        self._advisor = None if blind else Process("advisor", config, outbox)
        self._navigator = Process("navigator", config, outbox)
        self._controller = Process("controller", config, outbox)
        self._processes = [p for p in (self._advisor, self._navigator, self._controller) if p is not None]
        self._advise_due_us = self._navigate_due_us = self._control_due_us = self._route_due_us = 0
        self._stale_us: int | None = None
        self._woken = False
        self._command_us = 0
        self.advisory: m.Advisory | None = None
        self.command: m.NavCommand | None = None

    def hear(self, topic: keys.Topic[Any], message: m.Message, now_us: int) -> None:
        """A message reaches every process that listens to it."""
        for process in self._processes:
            if topic.name in process.inputs:
                process.inputs[topic.name] = Input(message, now_us)
        if topic is keys.EVIDENCE:
            self._advise_due_us = now_us
        self._woken |= topic.name in WAKES_NAVIGATOR

    def step(self, now_us: int) -> m.Thrust | None:
        """Whatever is due now; the thrust that came of it, if any did."""
        if now_us >= self._advise_due_us or (self._stale_us is not None and now_us >= self._stale_us):
            self._advise(now_us)
        if now_us >= self._route_due_us:
            self._navigator.publish_own(keys.MISSION, msgspec.structs.replace(self._mission, source_us=now_us), now_us)
            leg = self._mission.legs[0]
            route = m.Route(source_us=now_us, name=self._mission.name, waypoints=leg.waypoints, repeat=leg.repeat)
            self._navigator.publish_own(keys.ROUTE, route, now_us)
            self._route_due_us = now_us + round(1e6 / keys.ROUTE.rate_hz)
        ordered = (self._woken or now_us >= self._navigate_due_us) and self._navigate(now_us)
        if ordered or now_us >= self._control_due_us:
            return self._control(now_us)
        return None

    def _advise(self, now_us: int) -> None:
        self._advise_due_us = now_us + round(1e6 / self._config.advisor.rate_hz)
        if self._advisor is None:
            ahead = msgspec.structs.replace(AHEAD, source_us=now_us)
            advisory: m.Message = self._outbox.put(keys.ADVISORY, ahead, now_us)
        else:
            sent = self._advisor.conclude(self._advisor.decide(now_us), now_us)
            advisory = sent[keys.ADVISORY.name]
        assert isinstance(advisory, m.Advisory)
        self.advisory = advisory
        stale_us = advisory.source_us + round(self._config.advisor.evidence_max_age_s * 1e6) + 1
        self._stale_us = stale_us if self._advisor is not None and now_us < stale_us else None
        self.hear(keys.ADVISORY, advisory, now_us)

    def _navigate(self, now_us: int) -> bool:
        """Whether an order went out: at `rate_hz`, and at once when evidence, advice or a gate changes."""
        self._woken = False
        period_us = round(1e6 / self._config.navigator.rate_hz)
        self._navigate_due_us = now_us + period_us
        outputs = self._navigator.decide(now_us)
        order = outputs[keys.COMMAND.name]
        assert isinstance(order, m.NavCommand)
        if now_us - self._command_us < period_us and not order.is_news_after(self.command):
            self._navigator.conclude({}, now_us)
            return False
        sent = self._navigator.conclude(outputs, now_us)[keys.COMMAND.name]
        assert isinstance(sent, m.NavCommand)
        self.command, self._command_us = sent, now_us
        self.hear(keys.COMMAND, sent, now_us)
        return True

    def _control(self, now_us: int) -> m.Thrust:
        self._control_due_us = now_us + round(SILENCE_PERIODS * 1e6 / self._config.controller.rate_hz)
        sent = self._controller.conclude(self._controller.decide(now_us), now_us)[keys.THRUST.name]
        assert isinstance(sent, m.Thrust)
        return sent
