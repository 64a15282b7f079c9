"""Operator console: answers requests, publishes the state, and keeps the STOP latch on disk."""

from __future__ import annotations

import asyncio
from pathlib import Path

from paani import keys
from paani import messages as m
from paani.bus import Publisher
from paani.clock import Clock
from paani_services.operator import state as op
from paani_services.operator.latch import LATCH_FILE, read_latch, write_latch


class Console:
    """A STOP is published before anything else is tried; whoever arms waits until the latch on disk says so.

    On disk the latch is clear only while nobody is armed and no STOP holds: a STOP that cannot be written, or a process
    that dies while the boat is armed, is a STOP for the next start.
    """

    def __init__(
        self, arming: Publisher[m.Arming], states: Publisher[m.OperatorState], folder: Path, clock: Clock
    ) -> None:
        self._arming, self._states, self._clock = arming, states, clock
        self._path = folder / LATCH_FILE
        self._write_lock = asyncio.Lock()
        self._latch_kept = True
        self.state = op.Operator()

    async def restore(self) -> None:
        """Restore the latch of an earlier run. A missing or unreadable latch counts as a STOP."""
        self.state = op.initial_state(await asyncio.to_thread(read_latch, self._path))

    async def answer(self, client: str, request: m.OperatorRequest, station_epoch: int | None) -> None:
        """Do what the client asks. station_epoch: of the page's process, None where it is not alive."""
        now_us = self._clock.now_us()
        match request.act:
            case m.RequestAct.STOP:
                await self.stop(client)
            case m.RequestAct.HOLD:
                self._become(op.hold(self.state, client, request.press, now_us))
            case m.RequestAct.RELEASE:
                if self._is_answered(client, request.press):
                    return
                refusal = op.judge_release(self.state, client, request.press, now_us)
                if refusal is m.ArmRefusal.NONE and station_epoch is None:
                    refusal = m.ArmRefusal.NO_STATION
                if refusal is m.ArmRefusal.NONE:
                    refusal = await self._arm(client, request.press, station_epoch or 0)
                if refusal is not m.ArmRefusal.NONE:
                    self._become(op.refuse(self.state, client, request.press, refusal))

    async def stop(self, client: str) -> None:
        """Latch a STOP."""
        self._become(op.latch_stop(self.state, client, self._clock.now_us()))
        await self._keep()

    async def follow_station(self, epoch: int, silent_s: float) -> None:
        """Disarm where the page's process has gone or begun again."""
        was_armed = self.state.armed
        self._become(op.follow_station(self.state, epoch, silent_s))
        if was_armed and not self.state.armed:
            await self._keep()

    def confirm_stop(self, applied: m.ThrustApplied) -> None:
        """Take what the plant applies as the confirmation of a STOP that waits for one."""
        self._become(op.confirm_stop(self.state, applied, self._clock.now_us()))

    def publish(self) -> None:
        """Publish the present state now."""
        now_us = self._clock.now_us()
        self._arming.put(op.arming_message(self.state, now_us))
        self._states.put(op.state_message(self.state, now_us, latch_kept=self._latch_kept))

    async def publish_forever(self) -> None:
        """Publish the state at the rate of its topic."""
        while True:
            self.publish()
            await asyncio.sleep(1.0 / keys.ARMING.rate_hz)

    async def end(self) -> None:
        """The end in good order: nobody arms any more, and only a STOP is left on disk."""
        self.state = op.follow_station(self.state, -1, 0.0)
        self.publish()
        await self._keep()

    async def _arm(self, client: str, press: int, station_epoch: int) -> m.ArmRefusal:
        """Arm; why not, where a STOP came meanwhile or the latch could not be written."""
        stops = self.state.stops
        async with self._write_lock:
            if not await asyncio.to_thread(write_latch, self._path, op.ARMED):
                return m.ArmRefusal.NOT_WRITTEN
            if self.state.stops == stops:
                self._become(op.arm(self.state, client, press, station_epoch))
                self._latch_kept = True
                return m.ArmRefusal.NONE
        await self._keep()
        return m.ArmRefusal.STOPPED

    def _is_answered(self, client: str, press: int) -> bool:
        """Whether this press has ended, so that a RELEASE said again changes nothing."""
        ended, held = self.state.ended, self.state.hold
        return (ended.client, ended.press) == (client, press) and (held is None or held.press != press)

    def _become(self, state: op.Operator) -> None:
        """Take a new state, and publish it at once where it says something new."""
        before, self.state = self.state, state
        if before != state:
            self.publish()

    async def _keep(self) -> None:
        """Write the latch of the present state to disk."""
        async with self._write_lock:
            self._latch_kept = await asyncio.to_thread(write_latch, self._path, op.latch_text(self.state))
        self.publish()
