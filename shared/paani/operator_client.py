"""Asks the operator's process, as one of its clients, to stop the boat, to arm it, or to drive it."""

from __future__ import annotations

import asyncio
import secrets
from collections.abc import Callable

from paani import keys
from paani import messages as m
from paani.bus import Bus
from paani.clock import Clock, has_passed

REPEAT_S = 0.1
POLL_S = 0.02
HOLD_S = 1.2  # a little over the least that arms


class OperatorClient:
    """A client that is named by the user of its bus. Requests are said again until they are answered.

    `states`: the operator's state, for one reader who awaits each; the client itself only looks at the newest.
    `hand`: who asks, where a request names no other; of one client several hands may ask, as each page does.
    """

    def __init__(self, bus: Bus, clock: Clock) -> None:
        self.name, self._clock = bus.user, clock
        self._requests = bus.publisher(keys.REQUESTS[bus.user])
        self.states = bus.latest(keys.OPERATOR_STATE)
        self.hand = secrets.randbits(32) + 1
        self._drives = 0

    @property
    def state(self) -> m.OperatorState | None:
        """What the operator's process said last; None where that is too long ago to be true still."""
        return self.states.fresh(keys.OPERATOR_STATE.fresh_s)

    async def stop(self, timeout_s: float) -> m.OperatorState | None:
        """Ask for STOP; the state in which it is latched, or None where nobody has answered in time."""
        heard_before, before = self.states.received, self.states.value

        def is_latched(state: m.OperatorState) -> bool:
            """A state of before the request says nothing of it, though a STOP held then too."""
            is_answer = before is None or (state.epoch, state.stops) != (before.epoch, before.stops)
            return state.stopped and is_answer and self.states.received > heard_before

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

    @property
    def holds_wheel(self) -> bool:
        """Whether this client's own hand holds the wheel, as far as that is known now."""
        state = self.state
        return state is not None and (state.wheel_by, state.wheel_hand) == (self.name, self.hand)

    async def set_mode(self, mode: m.DriveMode, timeout_s: float = 1.0, hand: int = 0) -> m.ModeRefusal | None:
        """Ask for a mode: why it is not in force, NONE where it is; None where nobody has answered in time.

        A hand that MANUAL is given to drives within 2 s, or it ends.
        """
        return await self._ask_wheel(m.RequestAct.MODE, timeout_s, hand, mode)

    async def take_wheel(self, timeout_s: float = 1.0, hand: int = 0) -> m.ModeRefusal | None:
        """Take the wheel from whoever holds it; answered as `set_mode` is. MANUAL of another hand ends."""
        return await self._ask_wheel(m.RequestAct.WHEEL, timeout_s, hand)

    async def override(self, timeout_s: float = 1.0, hand: int = 0) -> m.ModeRefusal | None:
        """In MANUAL, for 10 s from now, the advice does not veto; answered as `set_mode` is."""
        return await self._ask_wheel(m.RequestAct.OVERRIDE, timeout_s, hand)

    def drive(self, surge: float, turn: float, hand: int = 0, number: int = 0) -> None:
        """Say what the hand wants in MANUAL, ahead and to port in [-1, 1]; to be said again at least every 0.2 s.

        number: grows with each set-point of a hand that is not the client's own. Without the wheel nothing happens.
        Raises ValueError beyond the range.
        """
        if not (-1.0 <= surge <= 1.0 and -1.0 <= turn <= 1.0):
            raise ValueError(f"surge {surge} or turn {turn} is not in [-1, 1]")
        self._drives += 1
        self._put(m.RequestAct.DRIVE, number or self._drives, hand or self.hand, surge=surge, turn=turn)

    async def _ask_wheel(
        self, act: m.RequestAct, timeout_s: float, hand: int, mode: m.DriveMode = m.DriveMode.IDLE
    ) -> m.ModeRefusal | None:
        press = secrets.randbits(32) + 1

        def is_answered(state: m.OperatorState) -> bool:
            return (state.answered_by, state.answered) == (self.name, press)

        state = await self._ask(act, press, is_answered, timeout_s, hand or self.hand, mode)
        return None if state is None else state.mode_refusal

    async def _ask(
        self,
        act: m.RequestAct,
        press: int,
        is_answer: Callable[[m.OperatorState], bool],
        timeout_s: float,
        hand: int = 0,
        mode: m.DriveMode = m.DriveMode.IDLE,
    ) -> m.OperatorState | None:
        asked_us = 0
        try:
            async with asyncio.timeout(timeout_s):
                while (state := self.state) is None or not is_answer(state):
                    now_us = self._clock.now_us()
                    if has_passed(asked_us, REPEAT_S * 1e6, now_us):
                        self._put(act, press, hand, mode=mode)
                        asked_us = now_us
                    await asyncio.sleep(POLL_S)
        except TimeoutError:
            return None
        return state

    def _put(
        self,
        act: m.RequestAct,
        press: int,
        hand: int = 0,
        *,
        mode: m.DriveMode = m.DriveMode.IDLE,
        surge: float = 0.0,
        turn: float = 0.0,
    ) -> None:
        now_us = self._clock.now_us()
        self._requests.put(
            m.OperatorRequest(source_us=now_us, act=act, press=press, hand=hand, mode=mode, surge=surge, turn=turn)
        )
