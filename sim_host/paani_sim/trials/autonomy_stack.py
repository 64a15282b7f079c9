"""The board's deciding processes on a simulated clock, woken when their services wake.

Each one is stepped by `paani.bus.Stepper`, as its live service is. Messages between them take no time; what perception
takes is the drive's `perception_latency_s`.
"""

from __future__ import annotations

from typing import Any

import msgspec

from paani import keys
from paani import messages as m
from paani.bus import Stepper
from paani.clock import Clock
from paani.config import Config
from paani.decider import decider_of
from paani.motion_planning import MotionPlanner
from paani_sim.trials.lockstep_bus import LockstepBus, LockstepInbox

SILENCE_PERIODS = 1.5  # the controller steps without a new command after so many of its periods, as its live service
WAKES_NAVIGATOR = frozenset(topic.name for topic in (keys.ADVISORY, keys.ODOMETRY, keys.ARMING))
STRAIGHT_AHEAD = m.Advisory(source_us=0, direction=m.Direction.STRAIGHT, reason=m.Reason.CENTER_CLEAR)


class AutonomyStack:
    """Advisor, navigator and controller. `blind`: no advisor; the advice is always to go straight on.

    mission: its first leg follows a route. planner: in place of the navigator's own.
    """

    def __init__(
        self,
        config: Config,
        mission: m.Mission,
        bus: LockstepBus,
        clock: Clock,
        *,
        blind: bool = False,
        planner: MotionPlanner | None = None,
    ) -> None:
        def open_stepper(service: str, planner: MotionPlanner | None = None) -> Stepper[Any, LockstepInbox]:
            decider = decider_of(service)
            if planner is not None and decider.with_planner is not None:
                decider = decider.with_planner(planner)
            return Stepper(bus, clock, config, decider)

        self._config, self._mission, self._bus, self._clock = config, mission, bus, clock
        self._advisor = None if blind else open_stepper("advisor")
        self._navigator = open_stepper("navigator", planner)
        self._controller = open_stepper("controller")
        self._advise_due_us = self._navigate_due_us = self._control_due_us = self._route_due_us = 0
        self._evidence_stale_us: int | None = None
        self._is_navigator_woken = False
        self._command_us = 0
        self.advisory: m.Advisory | None = None
        self.command: m.NavCommand | None = None

    def deliver(self, topic: keys.Topic[Any], message: m.Message) -> None:
        """A message reaches every process that subscribes to it."""
        self._bus.deliver(topic, message)
        if topic is keys.EVIDENCE:
            self._advise_due_us = self._clock.now_us()
        self._is_navigator_woken |= topic.name in WAKES_NAVIGATOR

    def step(self) -> m.Thrust | None:
        """Step every process that is due; returns the thrust command if the controller sent one."""
        now_us = self._clock.now_us()
        if now_us >= self._advise_due_us or (self._evidence_stale_us is not None and now_us >= self._evidence_stale_us):
            self._advise(now_us)
        if now_us >= self._route_due_us:
            self._navigator.publish_own(keys.MISSION, msgspec.structs.replace(self._mission, source_us=now_us))
            leg = self._mission.legs[0]
            route = m.Route(source_us=now_us, name=self._mission.name, waypoints=leg.waypoints, repeat=leg.repeat)
            self._navigator.publish_own(keys.ROUTE, route)
            self._route_due_us = now_us + round(1e6 / keys.ROUTE.rate_hz)
        is_commanded = (self._is_navigator_woken or now_us >= self._navigate_due_us) and self._navigate()
        if is_commanded or now_us >= self._control_due_us:
            return self._control()
        return None

    def _advise(self, now_us: int) -> None:
        self._advise_due_us = now_us + round(1e6 / self._config.advisor.rate_hz)
        if self._advisor is None:
            advisory = self._bus.put(keys.ADVISORY, msgspec.structs.replace(STRAIGHT_AHEAD, source_us=now_us))
        else:
            _, outputs = self._advisor.decide()
            sent = self._advisor.conclude(outputs)[keys.ADVISORY.name]
            assert isinstance(sent, m.Advisory)
            advisory = sent
        self.advisory = advisory
        stale_us = advisory.source_us + round(self._config.advisor.evidence_max_age_s * 1e6) + 1
        self._evidence_stale_us = stale_us if self._advisor is not None and now_us < stale_us else None
        self.deliver(keys.ADVISORY, advisory)

    def _navigate(self) -> bool:
        """Whether a command went out: at `rate_hz`, and at once when evidence, advice or an interlock changes."""
        self._is_navigator_woken = False
        period_us = round(1e6 / self._config.navigator.rate_hz)
        now_us, outputs = self._navigator.decide()
        self._navigate_due_us = now_us + period_us
        command = outputs[keys.COMMAND.name]
        assert isinstance(command, m.NavCommand)
        if now_us - self._command_us < period_us and not command.is_news_after(self.command):
            self._navigator.conclude({})
            return False
        sent = self._navigator.conclude(outputs)[keys.COMMAND.name]
        assert isinstance(sent, m.NavCommand)
        self.command, self._command_us = sent, now_us
        self.deliver(keys.COMMAND, sent)
        return True

    def _control(self) -> m.Thrust:
        now_us, outputs = self._controller.decide()
        self._control_due_us = now_us + round(SILENCE_PERIODS * 1e6 / self._config.controller.rate_hz)
        sent = self._controller.conclude(outputs)[keys.THRUST.name]
        assert isinstance(sent, m.Thrust)
        return sent
