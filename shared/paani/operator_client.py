"""Asks the operator's process, as one of its clients, to stop the boat or to arm it."""

from __future__ import annotations

import asyncio
import secrets
from collections.abc import Callable

from paani import keys
from paani import messages as m
from paani.bus import Bus
from paani.clock import Clock

REPEAT_S = 0.1
POLL_S = 0.02
HOLD_S = 1.2  # a little over the least that arms


class OperatorClient:
    """A client that is named by the user of its bus. Requests are said again until they are answered.

    `states`: the operator's state, for one reader who awaits each; the client itself only looks at the newest.
    """

    def __init__(self, bus: Bus, clock: Clock) -> None:
        self.name, self._clock = bus.user, clock
        self._requests = bus.publisher(keys.REQUESTS[bus.user])
        self.states = bus.latest(keys.OPERATOR_STATE)

    @property
    def state(self) -> m.OperatorState | None:
        """What the operator's process said last; None where that is too long ago to be true still."""
        return self.states.value if self.states.receipt_age_s() <= keys.OPERATOR_STATE.fresh_s else None

    async def stop(self, timeout_s: float) -> m.OperatorState | None:
        """Ask for STOP; the state in which it is latched, or None where nobody has answered in time."""
        begun_us = self._clock.now_us()

        def is_latched(state: m.OperatorState) -> bool:
            return state.stopped and self.states.received_us >= begun_us

        return await self._ask(m.RequestAct.STOP, 0, is_latched, timeout_s)

    def hold(self, press: int) -> None:
        """Say that the button of this press is held; to be said again at least every 0.6 s."""
        self._put(m.RequestAct.HOLD, press)

    async def release(self, press: int, timeout_s: float) -> m.ArmRefusal | None:
        """Let the button go: why that did not arm, NONE where it did; None where nobody has answered in time."""

        def is_ended(state: m.OperatorState) -> bool:
            return (state.press_by, state.press) == (self.name, press)

        state = await self._ask(m.RequestAct.RELEASE, press, is_ended, timeout_s)
        return None if state is None else state.refusal

    async def hold_to_arm(self, timeout_s: float = 2.0) -> m.ArmRefusal | None:
        """One press, held for as long as it takes; answered as `release` is."""
        press = secrets.randbits(32) + 1
        for _ in range(round(HOLD_S / REPEAT_S)):
            self.hold(press)
            await asyncio.sleep(REPEAT_S)
        return await self.release(press, timeout_s)

    async def _ask(
        self, act: m.RequestAct, press: int, is_answer: Callable[[m.OperatorState], bool], timeout_s: float
    ) -> m.OperatorState | None:
        due_us = 0
        try:
            async with asyncio.timeout(timeout_s):
                while (state := self.state) is None or not is_answer(state):
                    if (now_us := self._clock.now_us()) >= due_us:
                        self._put(act, press)
                        due_us = now_us + round(REPEAT_S * 1e6)
                    await asyncio.sleep(POLL_S)
        except TimeoutError:
            return None
        return state

    def _put(self, act: m.RequestAct, press: int) -> None:
        self._requests.put(m.OperatorRequest(source_us=self._clock.now_us(), act=act, press=press))
