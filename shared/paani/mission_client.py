"""Asks the operator's process, as one of its clients, to put another mission, fence or rally points in force."""

from __future__ import annotations

import asyncio
import secrets
from typing import NamedTuple

from msgspec.structs import replace

from paani import keys
from paani import messages as m
from paani.bus import Bus
from paani.clock import Clock, has_passed
from paani.missions import find_mission_fault, find_rally_fault

REPEAT_S = 2.0  # a mission of 10,000 waypoints is half a megabyte, and takes seconds to check
POLL_S = 0.02

MISSION_REFUSALS = {  # as a ground station can show them: at most 50 characters
    m.MissionRefusal.INVALID: "the navigator could not take it",
    m.MissionRefusal.UNDER_WAY: "the boat is armed in ROUTE: order HOLD first",
    m.MissionRefusal.FENCE_IN_USE: "another fence while armed needs IDLE",
    m.MissionRefusal.NOT_HOLDER: "another hand holds the wheel",
    m.MissionRefusal.NOT_KNOWN: "the navigator is not heard: ask again",
    m.MissionRefusal.BUSY: "somebody arms, or sends a mission: ask again",
}


class MissionAnswer(NamedTuple):
    """NONE: it is in force. INVALID: `fault` says what is wrong, and where."""

    refusal: m.MissionRefusal
    fault: str = ""


class MissionClient:
    """A client that is named by the user of its bus. Its requests are said again until they are answered."""

    def __init__(self, bus: Bus, clock: Clock) -> None:
        self.name, self._clock = bus.user, clock
        self._requests = bus.publisher(keys.MISSION_REQUESTS[bus.user])
        self._states = bus.latest(keys.OPERATOR_STATE)
        self._one_at_a_time = asyncio.Lock()  # the operator's process tells each client its newest answer alone

    async def send(
        self,
        name: str = "",
        *,
        legs: tuple[m.MissionLeg, ...] | None = None,
        fence: tuple[m.FenceArea, ...] | None = None,
        rally: tuple[m.Waypoint, ...] | None = None,
        timeout_s: float = 20.0,
        hand: int = 0,
    ) -> MissionAnswer | None:
        """Ask for these parts; None: those in force stay. None where nobody has answered in time.

        Without legs there is nothing to do, without areas no fence, and without rally points RETURN leads home.
        """
        request = m.MissionRequest(
            source_us=0, press=0, name=name, legs=legs or (), fence=fence or (), rally=rally or (),
            keep_legs=legs is None, keep_fence=fence is None, keep_rally=rally is None,
        )  # fmt: skip
        return await self._ask(request, timeout_s, hand)

    async def _ask(self, request: m.MissionRequest, timeout_s: float, hand: int) -> MissionAnswer | None:
        """What could not travel, as numbers that are none, or is too much for a message, is refused here."""
        fault = await asyncio.to_thread(find_mission_fault, request.legs, (), 0.0)
        fault = fault or await asyncio.to_thread(find_mission_fault, (), request.fence, 0.0)
        fault = fault or find_rally_fault(request.rally, (), 0.0)
        if fault:
            return MissionAnswer(m.MissionRefusal.INVALID, fault)
        press = secrets.randbits(32) + 1
        asked_us = 0
        try:
            async with asyncio.timeout(timeout_s), self._one_at_a_time:
                while (answer := self._answer_to(press)) is None:
                    now_us = self._clock.now_us()
                    if has_passed(asked_us, REPEAT_S * 1e6, now_us):
                        self._requests.put(replace(request, source_us=now_us, press=press, hand=hand))
                        asked_us = now_us
                    await asyncio.sleep(POLL_S)
        except TimeoutError:
            return None
        return answer

    def _answer_to(self, press: int) -> MissionAnswer | None:
        state = self._states.fresh(keys.OPERATOR_STATE.fresh_s)
        if state is None or (state.mission_answered_by, state.mission_answered) != (self.name, press):
            return None
        return MissionAnswer(state.mission_refusal, state.mission_fault)
