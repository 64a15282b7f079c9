"""What ground stations ask of the operator's process, done by a client of it."""

from __future__ import annotations

import asyncio
import itertools
from collections.abc import Awaitable, Callable

from paani import messages as m
from paani.clock import Clock
from paani.mission_client import MissionAnswer, MissionClient
from paani.operator_client import OperatorClient
from paani_services.mavlink.commands import (
    IN_PROGRESS,
    LATER,
    MISSION_ERROR,
    Act,
    arm_result,
    mission_result,
    mode_result,
    stop_result,
)
from paani_services.mavlink.gateway import Request
from paani_services.mavlink.mission_exchange import MissionOrder
from paani_services.mavlink.snapshot import Snapshot
from paani_services.mavlink.station import Source, Station
from paani_services.mavlink.uploads import acknowledge

PROGRESS_S = 0.4  # stations ask again after half a second without an answer
LOOKS_PER_PROGRESS = 8  # whether the station that arms is still there
STOP_TIMEOUT_S = 1.0
SHOWN_TIMEOUT_S, SHOWN_PERIOD_S = 0.5, 0.01  # the mission in force comes by another key than the answer
NOT_YET = "mission: the one before is not in force yet"
MISSION_NAME = "uploaded"  # the protocol has no names


def is_repeated(request: Request, under_way: Request) -> bool:
    """Whether a station asks once more for the mode, or the wheel, that it is about to be answered.

    That answer is for both: MAVSDK takes IN_PROGRESS to a mode for a refusal, and falls at the answer that follows.
    """
    return (request.command, request.act, request.mode) == (under_way.command, under_way.act, under_way.mode)


class Acts:
    """One press of the button at a time, and one mode of a station; a STOP waits for nothing.

    count: something refused, by its cause. hands: of the stations that are there. shows: whether a download gives
    what an order asked for.
    """

    def __init__(
        self,
        client: OperatorClient,
        missions: MissionClient,
        clock: Clock,
        count: Callable[[str], None],
        hands: Callable[[], frozenset[int]],
        shows: Callable[[MissionOrder], bool],
    ) -> None:
        self._client, self._missions, self._clock = client, missions, clock
        self._count, self._hands, self._shows = count, hands, shows
        self._changing: dict[Station, Request] = {}
        self._orders: dict[tuple[Station, Source], MissionOrder] = {}
        self._tasks = set[asyncio.Task[None]]()
        self._arming: Request | None = None
        self._stopping: asyncio.Task[m.OperatorState | None] | None = None

    def ask(self, request: Request) -> None:
        """Begin; the station is told how it ended."""
        if request.act is Act.STOP:
            self._start(self._stop(request))
        elif request.act in {Act.MODE, Act.WHEEL}:
            if (under_way := self._changing.get(request.station)) is not None:
                if not is_repeated(request, under_way):
                    self._acknowledge(request, LATER, "")
            else:
                self._changing[request.station] = request
                self._start(self._turn_wheel(request))
        elif self._arming is None:
            self._arming = request
            self._start(self._arm(request))
        else:
            is_own = request.station is self._arming.station
            self._acknowledge(request, IN_PROGRESS if is_own else LATER, "")

    def send(self, order: MissionOrder) -> None:
        """Begin to put a mission, a fence or rally points in force; the station is told how it ended.

        One order at a time of each who asks. The same one asked for again is answered with it.
        """
        under_way = self._orders.setdefault((order.station, order.target), order)
        if under_way is order:
            self._start(self._send_mission(order))
        elif under_way != order:
            self._count("mavlink_refused")
            acknowledge(order.station, order.target, MISSION_ERROR, order.kind, self._clock.now_us(), NOT_YET)

    async def stop(self) -> m.OperatorState | None:
        """The state in which STOP is latched, None where nobody answers. Whoever asks meanwhile has the same answer."""
        if self._stopping is None or self._stopping.done():
            self._stopping = asyncio.create_task(self._client.stop(STOP_TIMEOUT_S), name="stop")
        return await asyncio.shield(self._stopping)

    def close(self) -> None:
        """End what is under way: a button that is no longer held arms nothing."""
        for task in (*self._tasks, *([self._stopping] if self._stopping is not None else [])):
            task.cancel()

    async def _stop(self, request: Request) -> None:
        self._acknowledge(request, *stop_result(await self.stop()))

    async def _arm(self, request: Request) -> None:
        holding = asyncio.create_task(self._client.hold_to_arm(), name="hold")
        try:
            for number in itertools.count():
                if number % LOOKS_PER_PROGRESS == 0:
                    self._acknowledge(request, IN_PROGRESS, "")
                await asyncio.wait({holding}, timeout=PROGRESS_S / LOOKS_PER_PROGRESS)
                if holding.done():
                    self._acknowledge(request, *arm_result(holding.result()))
                    return
                if request.hand not in self._hands():
                    return  # who is gone holds no button
        finally:
            holding.cancel()
            self._arming = None

    async def _send_mission(self, order: MissionOrder) -> None:
        try:
            await self._send_and_acknowledge(order)
        finally:
            del self._orders[order.station, order.target]

    async def _send_and_acknowledge(self, order: MissionOrder) -> None:
        answer, hand = await self._put_in_force(order), order.station.hand_of(order.target)
        is_barred = answer is not None and answer.refusal is m.MissionRefusal.NOT_HOLDER
        if is_barred and self._is_wheel_left() and await self._client.take_wheel(hand=hand) is m.ModeRefusal.NONE:
            answer = await self._put_in_force(order)
        result, text = mission_result(answer)
        if text:
            self._count("mavlink_refused")
        else:
            await self._until_shown(order)
        acknowledge(order.station, order.target, result, order.kind, self._clock.now_us(), text)

    async def _until_shown(self, order: MissionOrder) -> None:
        """A station that downloads at once is given what it sent, unless somebody else has sent more meanwhile."""
        for _ in range(round(SHOWN_TIMEOUT_S / SHOWN_PERIOD_S)):
            if self._shows(order):
                return
            await asyncio.sleep(SHOWN_PERIOD_S)

    async def _put_in_force(self, order: MissionOrder) -> MissionAnswer | None:
        name = "" if order.legs is None else MISSION_NAME
        return await self._missions.send(
            name, legs=order.legs, fence=order.fence, rally=order.rally, hand=order.station.hand_of(order.target)
        )

    def _is_wheel_left(self) -> bool:
        """Whether the wheel is in the hand of a station that is gone."""
        state = self._client.state
        return state is not None and state.wheel_by == self._client.name and state.wheel_hand not in self._hands()

    async def _turn_wheel(self, request: Request) -> None:
        try:
            if request.act is Act.WHEEL:
                refusal = await self._client.take_wheel(hand=request.hand)
                is_given = refusal is m.ModeRefusal.NONE
                request.station.answer_control(request.target[0], self._clock.now_us(), is_given=is_given)
            else:
                self._acknowledge(request, *mode_result(await self._change_mode(request)))
        finally:
            self._changing.pop(request.station, None)

    async def _change_mode(self, request: Request) -> m.ModeRefusal | None:
        """A wheel that was left by a station that is gone is taken; from anybody else it is not."""
        hand = request.hand
        refusal = await self._client.set_mode(request.mode, hand=hand)
        if refusal is not m.ModeRefusal.NOT_HOLDER or not self._is_wheel_left():
            return refusal
        refusal = await self._client.take_wheel(hand=hand)
        return await self._client.set_mode(request.mode, hand=hand) if refusal is m.ModeRefusal.NONE else refusal

    def _start(self, work: Awaitable[None]) -> None:
        task = asyncio.ensure_future(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    def _acknowledge(self, request: Request, result: int, text: str) -> None:
        if text:
            self._count("mavlink_refused")
        request.station.acknowledge(request.command, result, request.target, self._clock.now_us(), text)


def is_link_lost(snapshot: Snapshot, name: str, heard_us: int, limit_s: float) -> bool:
    """Whether a boat that this client armed is to be stopped, as no station has been heard for too long."""
    operator = snapshot.operator
    is_ours = snapshot.is_armed and operator is not None and operator.by == name
    return is_ours and not 0 <= snapshot.now_us - heard_us <= limit_s * 1e6
