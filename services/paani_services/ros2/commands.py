"""What ROS nodes may ask of the operator's process: STOP at any time; modes, stick and goals where `accept_commands`.

Nothing here drives by itself: MANUAL begins with a word on the topic `mode`, as on the page, and `cmd_vel` moves the
boat only while that holds. A stream of `cmd_vel` that goes on after a STOP, a lost link or another hand moves nothing.
A goal becomes the mission, by the checks of every mission, and is gone to once ROUTE is ordered after it.
"""

from __future__ import annotations

import asyncio
import logging
import math
from collections.abc import AsyncIterator
from typing import Any, NamedTuple

from paani import messages as m
from paani.bus import Bus, Queue
from paani.bus.ros_graph import RosGraph
from paani.clock import Clock
from paani.config import Config
from paani.geometry import clip
from paani.mission_client import MISSION_REFUSALS, MissionClient
from paani.operator_client import OperatorClient
from paani_services.ros2 import topics
from paani_services.ros2.frames import Frames
from paani_services.ros2.goals import leg_of_goal
from paani_services.ros2.schemas import decode
from paani_services.ros2.topics import RosTopic

LOG = logging.getLogger(__name__)
DEPTH = 16
ANSWER_S = 2.0
BATCH_PERIOD_S = 0.05  # of several set-points within this time the newest counts
GOAL_MISSION = "goal"  # the name of a mission that a goal became
TAKE_WHEEL = "WHEEL"  # the word that takes the wheel from another hand


class Stick(NamedTuple):
    """Ahead and to port, each as a part of the most that MANUAL gives, in [-1, 1]."""

    surge: float
    turn: float


def stick_of(twist: Any, full_speed_mps: float, full_turn_radps: float) -> Stick:
    """A geometry_msgs/Twist: `linear.x` [m/s] and `angular.z` [rad/s], cut where they exceed the most.

    A boat can do nothing with the rest. Raises ValueError where any number is not finite.
    """
    numbers = [getattr(part, axis) for part in (twist.linear, twist.angular) for axis in "xyz"]
    if not all(map(math.isfinite, numbers)):
        raise ValueError("a number is not finite")
    return Stick(clip(twist.linear.x / full_speed_mps, -1.0, 1.0), clip(twist.angular.z / full_turn_radps, -1.0, 1.0))


async def batches(inbox: Queue[bytes]) -> AsyncIterator[list[bytes]]:
    """What waits, at least one, oldest first; a node that floods gets this process's attention now and then."""
    while True:
        yield [await inbox.get(), *inbox.drain()]
        await asyncio.sleep(BATCH_PERIOD_S)


class Commands:
    """Hears the graph and asks the operator's process. What cannot be read or has no sense is counted."""

    def __init__(self, bus: Bus, clock: Clock, config: Config, graph: RosGraph) -> None:
        vessel, settings = config.bus.vessel, config.ros2
        self._bus, self._clock = bus, clock
        self._operator, self._missions = OperatorClient(bus, clock), MissionClient(bus, clock)
        self._map_frame, self._station_m = Frames(settings.frame_prefix).map, config.navigator.hold_radius_m
        self._full_speed_mps, self._full_turn_radps = config.navigator.cruise_mps, settings.full_turn_radps
        heard = topics.COMMANDS if settings.accept_commands else (topics.STOP,)
        self._inboxes = {topic.name: graph.subscribe(topic.endpoint(vessel), DEPTH) for topic in heard}

    def serve(self, group: asyncio.TaskGroup) -> None:
        """Take what is asked, each topic by a task of its own."""
        takers = {topics.STOP.name: self._take_stops, topics.MODE.name: self._take_modes}
        takers |= {topics.CMD_VEL.name: self._take_twists, topics.GOAL.name: self._take_goals}
        for name, inbox in self._inboxes.items():
            group.create_task(takers[name](inbox), name=name)

    async def _take_stops(self, inbox: Queue[bytes]) -> None:
        """Asks until the STOP is latched, for as long as that takes."""
        async for batch in batches(inbox):
            messages = [self._read(data, topics.STOP) for data in batch]
            asked = any(message is not None and message.data for message in messages)
            while asked and await self._operator.stop(ANSWER_S) is None:
                LOG.warning("STOP from ROS 2: the operator's process does not answer; asking again")

    async def _take_modes(self, inbox: Queue[bytes]) -> None:
        async for batch in batches(inbox):
            for data in batch:
                if (message := self._read(data, topics.MODE)) is not None:
                    await self._order(message.data)

    async def _order(self, word: str) -> None:
        """Ask for what the word says, and tell in this process's health what became of it."""
        if word == TAKE_WHEEL:
            refusal = await self._operator.take_wheel(ANSWER_S)
        elif word in m.DriveMode.__members__:
            refusal = await self._operator.set_mode(m.DriveMode[word], ANSWER_S)
        else:
            self._bus.count_drop("out_of_range")
            return
        answer = "no answer" if refusal is None else "done" if refusal is m.ModeRefusal.NONE else refusal.value
        self._bus.note(f"{word} from ROS 2: {answer}")
        if refusal is not m.ModeRefusal.NONE:
            self._bus.count_drop("refused")
            LOG.warning("%s from ROS 2: %s", word, answer)

    async def _take_twists(self, inbox: Queue[bytes]) -> None:
        """The newest alone, once: a set-point that no node says again is let go by the operator's process."""
        async for batch in batches(inbox):
            self._steer(batch[-1])

    async def _take_goals(self, inbox: Queue[bytes]) -> None:
        """The newest alone: who sends a second goal before the first was answered has changed their mind."""
        async for batch in batches(inbox):
            message = self._read(batch[-1], topics.GOAL)
            if message is not None:
                await self._go(message)

    async def _go(self, goal: Any) -> None:
        """Ask for a goal as the mission, and tell in this process's health what became of it."""
        try:
            leg = leg_of_goal(goal, self._map_frame, self._clock.now_us(), self._station_m)
        except ValueError as error:
            self._refuse_goal(str(error))
            return
        answer = await self._missions.send(GOAL_MISSION, legs=(leg,), hand=self._operator.hand)
        if answer is None:
            self._refuse_goal("no answer")
        elif answer.refusal is not m.MissionRefusal.NONE:
            self._refuse_goal(answer.fault or MISSION_REFUSALS[answer.refusal])
        else:
            self._bus.note("goal from ROS 2: it is the mission; ROUTE goes there")
            LOG.info("goal from ROS 2: the mission is to keep station at %s", leg.waypoints[0])

    def _refuse_goal(self, reason: str) -> None:
        self._bus.count_drop("refused")
        self._bus.note(f"goal from ROS 2: {reason}")
        LOG.warning("goal from ROS 2 refused: %s", reason)

    def _steer(self, data: bytes) -> None:
        message, state = self._read(data, topics.CMD_VEL), self._operator.state
        if message is None:
            return
        try:
            stick = stick_of(message, self._full_speed_mps, self._full_turn_radps)
        except ValueError:
            self._bus.count_drop("non_finite")
            return
        if state is None or state.mode is not m.DriveMode.MANUAL or not self._operator.holds_wheel:
            self._bus.count_drop("not_manual")
            return
        self._operator.drive(stick.surge, stick.turn)

    def _read(self, data: bytes, topic: RosTopic) -> Any | None:
        """The message; None for CDR that is cut short, too long or of another type."""
        try:
            return decode(data, topic.type)
        except ValueError:
            self._bus.count_drop("undecodable")
            return None
