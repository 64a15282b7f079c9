"""From a stick at a client to the thrust that it causes: the boat turns to port and to starboard in MANUAL."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import NamedTuple

from paani import keys
from paani import messages as m
from paani.authority import OBSERVER
from paani.bus import Latest, Queue, open_bus
from paani.bus.ros_graph import RosPublisher
from paani.clock import Clock
from paani.config import Config
from paani_services.mavlink.codec import dialect as mavlink
from paani_services.ros2 import topics
from paani_services.ros2.commands import TAKE_WHEEL
from paani_services.ros2.schemas import encode, make
from paani_tools.bench.ports.clients import GroundStation, ground_station, ros_node
from paani_tools.bench.ports.figures import StickLatencies

REPEAT_S = 0.1  # of a stick: within the dead man's time
ANSWER_S = 3.0  # of a stick that no thrust follows
MANUAL_S = 30.0  # until the boat is armed and gives it
HELD_S = 0.5  # after the thrust has followed
PHASE_S = 0.037  # by which each stick is held longer than the one before, so that they fall on no clock's beat
PHASES = 7
TURNING = 0.05  # difference of the two fans' thrust that is a turn and no trim
FULL = 1000  # deflection of a MAVLink stick


class Stick(NamedTuple):
    """A client's hand. ask_manual: says that it wants MANUAL; turn: the helm, 1 hard to port, -1 to starboard."""

    ask_manual: Callable[[], None]
    turn: Callable[[float], None]


async def steer(config: Config, clock: Clock, port: str, sticks: int) -> StickLatencies:
    """Turn an armed boat to and fro by this port. Raises TimeoutError where MANUAL is not given."""
    bus = await open_bus(config.bus, OBSERVER, clock)
    try:
        applied, orders = bus.queue(keys.THRUST_APPLIED), bus.latest(keys.OPERATOR_ORDER)
        if port == "mavlink":
            async with ground_station(config, lambda _: None) as station:
                return await _to_and_fro(_mavlink_stick(station), port, orders, applied, clock, sticks)
        graph = await ros_node(config, clock)
        try:
            publishers = {
                topic: graph.publisher(topic.endpoint(config.bus.vessel)) for topic in (topics.MODE, topics.CMD_VEL)
            }
            stick = _ros_stick(publishers[topics.MODE], publishers[topics.CMD_VEL], config, clock)
            return await _to_and_fro(stick, port, orders, applied, clock, sticks)
        finally:
            await graph.close()
    finally:
        await bus.close()


def follows(applied: m.ThrustApplied, turn: float) -> bool:
    """Whether the fans turn the boat as the stick says."""
    return turn * (applied.right - applied.left) > TURNING


async def _to_and_fro(
    stick: Stick, port: str, orders: Latest[m.OperatorOrder], applied: Queue[m.ThrustApplied], clock: Clock, sticks: int
) -> StickLatencies:
    latencies_s, turn, unanswered = list[float](), 1.0, 0
    await _take_manual(stick, port, orders, turn)
    await _hold(stick, turn, HELD_S)
    for number in range(sticks):
        turn = -turn
        applied.drain()
        said_us = clock.now_us()
        found_us = await _until_followed(stick, turn, applied, said_us)
        if found_us is None:
            unanswered += 1
            await _take_manual(stick, port, orders, turn)
        else:
            latencies_s.append((found_us - said_us) * 1e-6)
        await _hold(stick, turn, HELD_S + PHASE_S * (number % PHASES))
    return StickLatencies(latencies_s, unanswered)


async def _take_manual(stick: Stick, port: str, orders: Latest[m.OperatorOrder], turn: float) -> None:
    async with asyncio.timeout(MANUAL_S):
        while True:
            order: m.OperatorOrder | None = orders.fresh(keys.OPERATOR_ORDER.fresh_s)
            if order is not None and (order.mode, order.by) == (m.DriveMode.MANUAL, port):
                return
            stick.ask_manual()
            for _ in range(5):
                stick.turn(turn)
                await asyncio.sleep(REPEAT_S)


async def _hold(stick: Stick, turn: float, seconds: float) -> None:
    for _ in range(round(seconds / REPEAT_S)):
        stick.turn(turn)
        await asyncio.sleep(REPEAT_S)
    await asyncio.sleep(seconds % REPEAT_S)


async def _until_followed(stick: Stick, turn: float, applied: Queue[m.ThrustApplied], said_us: int) -> int | None:
    """When the adapter said that it applies such a thrust; None where it did not."""

    async def repeat() -> None:
        while True:
            stick.turn(turn)
            await asyncio.sleep(REPEAT_S)

    repeating = asyncio.create_task(repeat())
    try:
        async with asyncio.timeout(ANSWER_S):
            while True:
                thrust = await applied.get()
                if thrust.sent_us > said_us and follows(thrust, turn):
                    return thrust.sent_us
    except TimeoutError:
        return None
    finally:
        repeating.cancel()


def _mavlink_stick(station: GroundStation) -> Stick:
    """MANUAL_CONTROL, y to starboard."""

    def ask_manual() -> None:
        mode = (mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, 0, 0, 0, 0, 0, 0)  # ArduRover's MANUAL is 0
        station.send(mavlink.MAVLink_command_long_message(1, 1, mavlink.MAV_CMD_DO_SET_MODE, 0, *mode))

    def turn(to_port: float) -> None:
        station.send(mavlink.MAVLink_manual_control_message(1, 0, round(-to_port * FULL), 0, 0, 0))

    return Stick(ask_manual, turn)


def _ros_stick(mode: RosPublisher, cmd_vel: RosPublisher, config: Config, clock: Clock) -> Stick:
    """A Twist on `cmd_vel`, after a word on `mode`."""

    def ask_manual() -> None:
        for word in (TAKE_WHEEL, m.DriveMode.MANUAL.name):
            mode.put(encode(make("std_msgs/String", data=word)), clock.now_us())

    def turn(to_port: float) -> None:
        still = make("geometry_msgs/Vector3", x=0.0, y=0.0, z=0.0)
        turning = make("geometry_msgs/Vector3", x=0.0, y=0.0, z=to_port * config.ros2.full_turn_radps)
        cmd_vel.put(encode(make("geometry_msgs/Twist", linear=still, angular=turning)), clock.now_us())

    return Stick(ask_manual, turn)
