"""Operator console: answers requests, publishes state, mode and mission in force, and keeps the STOP latch on disk."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from pathlib import Path

import msgspec

from paani import keys
from paani import messages as m
from paani.bus import Publisher
from paani.clock import Clock, has_passed
from paani.map_origin import MapPlace, map_origin_deg
from paani.missions import find_mission_fault
from paani_services.operator import missions
from paani_services.operator import state as op
from paani_services.operator import wheel as w
from paani_services.operator.latch import LATCH_FILE, read_latch, write_latch
from paani_services.operator.return_place import find_seen_fault

LOG = logging.getLogger(__name__)
ARM_WITHIN_S = 1.0  # after the button was let go; whoever arms has turned away from a page that says nothing
WATCH_PERIOD_S = 0.02  # how late a stick that nobody holds may be let go


class Console:
    """A STOP is published before anything else is tried; whoever arms waits until the latch on disk says so.

    On disk the latch is clear only while nobody is armed and no STOP holds: a STOP that cannot be written, or a process
    that dies while the boat is armed, is a STOP for the next start. The order of what to do is published before the
    word that arms, and an accepted mission before the order that names it. read_facts: what the modes need, at any
    time. margin_m: the least distance of a mission from its fence.
    """

    def __init__(
        self,
        arming: Publisher[m.Arming],
        states: Publisher[m.OperatorState],
        orders: Publisher[m.OperatorOrder],
        accepted: Publisher[m.Mission],
        folder: Path,
        clock: Clock,
        read_facts: Callable[[], w.Facts] = w.Facts,
        margin_m: float = 0.0,
    ) -> None:
        self._arming, self._states, self._orders, self._accepted = arming, states, orders, accepted
        self._clock, self._read_facts, self._margin_m = clock, read_facts, margin_m
        self._path = folder / LATCH_FILE
        self._write_lock = asyncio.Lock()
        self._latch_kept = True
        self.state, self.wheel, self.mission = op.Operator(), w.Wheel(), missions.NO_MISSION
        self._mission_answer, self._mission_answers = missions.MissionAnswer(), dict[str, missions.MissionAnswer]()
        self._is_checking = False
        self._map_place: MapPlace | None = None  # by which the map is known that target and mission were placed in

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
            case m.RequestAct.MODE | m.RequestAct.WHEEL | m.RequestAct.DRIVE | m.RequestAct.OVERRIDE:
                facts, armed = self._facts(), self.state.armed
                self._turn(w.answer(self.wheel, client, request, facts, now_us, armed=armed))

    async def answer_mission(self, client: str, request: m.MissionRequest) -> None:
        """Check a mission, which may take seconds, and put it in force, or leave the present one there.

        Whether it may be is judged before and after: the mode may have changed meanwhile.
        """
        answer = self._mission_answers.get(client)
        if answer is not None and answer.press == request.press:
            self._say(answer)
            return
        refusal, fault = m.MissionRefusal.BUSY, ""
        if not self._is_checking:
            situation = self._situation(client, request.hand)
            refusal = missions.find_refusal(request, situation)
            if refusal is m.MissionRefusal.NONE and situation.present is not None:
                fault = await self._check(missions.merge(request, situation.present, 0))
                fault = fault or ("" if request.keep_rally else find_seen_fault(request.rally, self._facts().occupancy))
                situation = self._situation(client, request.hand)
                refusal = m.MissionRefusal.INVALID if fault else missions.find_refusal(request, situation)
            if refusal is m.MissionRefusal.NONE and situation.present is not None:
                self.mission = missions.merge(request, situation.present, self._clock.now_us())
                self.publish_mission()
        self._say(missions.MissionAnswer(client, request.press, refusal, fault))

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
        self._take_wheel(self.wheel, now_us)
        self._orders.put(self._order(now_us))
        self._arming.put(op.arming_message(self.state, now_us))
        state = op.state_message(self.state, now_us, latch_kept=self._latch_kept)
        state = w.with_wheel(state, self.wheel, self._facts(), now_us)
        self._states.put(missions.with_missions(state, self.mission, self._mission_answer))

    def publish_mission(self) -> None:
        """Publish the mission accepted last now."""
        self._accepted.put(msgspec.structs.replace(self.mission, source_us=self._clock.now_us()))

    async def publish_forever(self) -> None:
        """Publish the state at the rate of its topic."""
        while True:
            self.publish()
            await asyncio.sleep(1.0 / keys.ARMING.rate_hz)

    async def publish_mission_forever(self) -> None:
        """Publish the mission accepted last at the rate of its topic, for whoever joins late."""
        while True:
            self.publish_mission()
            await asyncio.sleep(1.0 / keys.ORDERED_MISSION.rate_hz)

    async def watch_wheel(self) -> None:
        """Let a stick go that nobody holds, and publish the order at the rate of its topic."""
        due_us, period_us = 0, round(1e6 / keys.OPERATOR_ORDER.rate_hz)
        while True:
            now_us = self._clock.now_us()
            self._turn(self.wheel)
            if not 0 < due_us - now_us <= period_us:
                self._orders.put(self._order(now_us))
                late_us = now_us - due_us
                due_us = now_us + period_us - (late_us if 0 <= late_us < period_us else 0)
            await asyncio.sleep(WATCH_PERIOD_S)

    async def end(self) -> None:
        """The end in good order: nobody arms any more, and only a STOP is left on disk."""
        self.state = op.follow_station(self.state, -1, 0.0)
        self.publish()
        await self._keep()

    async def _arm(self, client: str, press: int, station_epoch: int) -> m.ArmRefusal:
        """Arm; why not, where a STOP came meanwhile or the latch could not be written, or not in time."""
        stops, let_go_us = self.state.stops, self._clock.now_us()
        async with self._write_lock:
            if not await asyncio.to_thread(write_latch, self._path, op.ARMED):
                return m.ArmRefusal.NOT_WRITTEN
            is_late = has_passed(let_go_us, ARM_WITHIN_S * 1e6, self._clock.now_us())
            if self.state.stops == stops and not is_late:
                self._become(op.arm(self.state, client, press, station_epoch))
                self._latch_kept = True
                return m.ArmRefusal.NONE
        await self._keep()
        return m.ArmRefusal.NOT_WRITTEN if is_late else m.ArmRefusal.STOPPED

    def _is_answered(self, client: str, press: int) -> bool:
        """Whether this press has ended, so that a RELEASE said again changes nothing."""
        ended, held = self.state.ended, self.state.hold
        return (ended.client, ended.press) == (client, press) and (held is None or held.press != press)

    def _become(self, state: op.Operator) -> None:
        """Take a new state, and publish it at once where it says something new."""
        before, self.state = self.state, state
        if before != state:
            self.publish()

    def _turn(self, wheel: w.Wheel) -> None:
        """Take a new wheel, and publish it at once where it says something new; another set-point is the order's."""
        before, now_us = self.wheel, self._clock.now_us()
        self._take_wheel(wheel, now_us)
        if msgspec.structs.replace(self.wheel, stick=before.stick) != before:
            self.publish()
        elif self.wheel != before:
            self._orders.put(self._order(now_us))

    def _take_wheel(self, wheel: w.Wheel, now_us: int) -> None:
        """Take a new wheel as time has it; an override that begins or ends with it is logged."""
        before, self.wheel = self.wheel, w.lapse(wheel, now_us, armed=self.state.armed)
        if self.wheel.override_until_us and not before.override_until_us:
            LOG.warning("%s overrides the advice for %g s", self.wheel.by, w.OVERRIDE_S)
        if before.override_until_us and not self.wheel.override_until_us:
            LOG.warning("the advice is no longer overridden: %s", self.wheel.override_end)

    def _order(self, now_us: int) -> m.OperatorOrder:
        order = w.order_message(self.wheel, now_us, armed=self.state.armed)
        is_placed = bool(order.target) or self.mission.accepted_us > 0
        self._map_place = (self._map_place or self._facts().map_place) if is_placed else None
        latitude_deg, longitude_deg = (0.0, 0.0) if self._map_place is None else map_origin_deg(self._map_place)
        return msgspec.structs.replace(
            order,
            mission_us=self.mission.accepted_us,
            map_latitude_deg=latitude_deg,
            map_longitude_deg=longitude_deg,
        )

    def _facts(self) -> w.Facts:
        """What the modes need now; what was accepted here is in force as soon as the navigator hears it."""
        facts = msgspec.structs.replace(self._read_facts(), margin_m=self._margin_m)
        if self.mission.accepted_us:
            return msgspec.structs.replace(facts, mission=self.mission, has_mission=bool(self.mission.legs))
        return facts

    def _situation(self, client: str, hand: int) -> missions.Situation:
        held = self.state.hold
        return missions.Situation(
            mode=self.wheel.mode,
            armed=self.state.armed,
            present=self._facts().mission,
            may_steer=not self.wheel.by or (self.wheel.by, self.wheel.hand) == (client, hand),
            is_arming=held is not None and not op.is_silent(held, self._clock.now_us()),
        )

    async def _check(self, mission: m.Mission) -> str:
        self._is_checking = True
        try:
            return await asyncio.to_thread(
                find_mission_fault, mission.legs, mission.fence, self._margin_m, mission.rally, mission.land
            )
        finally:
            self._is_checking = False

    def _say(self, answer: missions.MissionAnswer) -> None:
        self._mission_answer = self._mission_answers[answer.client] = answer
        self.publish()

    async def _keep(self) -> None:
        """Write the latch of the present state to disk."""
        async with self._write_lock:
            self._latch_kept = await asyncio.to_thread(write_latch, self._path, op.latch_text(self.state))
        self.publish()
