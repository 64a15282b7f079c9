"""Clients of the ports, as a ground station, a ROS node, a viewer and a plotter are: how old is what reaches them?

Each speaks its protocol's own words over the port's own address, beside the port, in this process.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
import struct
from collections.abc import AsyncIterator, Callable, Coroutine, Mapping, Sequence
from typing import Any

import aiohttp
import msgspec
import numpy as np

from paani import keys
from paani import messages as m
from paani.authority import OBSERVER
from paani.bus import open_bus
from paani.bus.ros_graph import RosGraph, join_ros_graph
from paani.clock import Clock
from paani.config import Config
from paani.port_address import tcp_address
from paani_services.mavlink.codec import dialect as mavlink
from paani_services.ros2 import topics
from paani_services.ros2.schemas import decode

GROUND_STATION = (255, 190)  # system and component
HEARTBEAT_S = 1.0
REMEMBERED = 256  # poses that a telemetry message may still be of
FOXGLOVE_PROTOCOL, FOXGLOVE_DATA = "foxglove.sdk.v1", 1
FOXGLOVE_HEAD = struct.Struct("<BIQ")  # opcode, subscription, log time [ns]
DAY_S = 86_400.0
ROS_DEPTH = 16


class PoseStamps:
    """When each pose of the bus was measured, by its yaw rate as MAVLink's ATTITUDE has it (float32)."""

    def __init__(self) -> None:
        self._stamps: dict[float, int] = {}

    def note(self, pose: m.Odometry) -> None:
        """A pose of the bus."""
        rate = float(np.float32(-pose.yaw_rate_radps))
        self._stamps.pop(rate, None)
        self._stamps[rate] = pose.source_us
        while len(self._stamps) > REMEMBERED:
            del self._stamps[next(iter(self._stamps))]

    def measured_us(self, yaw_rate_radps: float) -> int | None:
        """None for a rate that no remembered pose had."""
        return self._stamps.get(yaw_rate_radps)


class GroundStation(asyncio.DatagramProtocol):
    """A MAVLink station at the first address that the port writes to; answers where it was written from."""

    def __init__(self, receive: Callable[[Any], None]) -> None:
        """receive: takes each message."""
        self._receive, self._parser = receive, mavlink.MAVLink(None, *GROUND_STATION)
        self._parser.robust_parsing = True
        self._transport: asyncio.DatagramTransport | None = None
        self._port: Any = None  # where the boat writes from

    def connection_made(self, transport: Any) -> None:
        self._transport = transport

    def datagram_received(self, data: bytes, addr: Any) -> None:
        self._port = addr
        for message in self._parser.parse_buffer(data) or ():
            self._receive(message)

    def send(self, message: Any) -> None:
        """To the boat, once it is known where that is."""
        if self._transport is not None and self._port is not None:
            self._transport.sendto(message.pack(self._parser), self._port)

    async def beat(self) -> None:
        """Be heard as a station."""
        while True:
            self.send(
                mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 0, 3)
            )
            await asyncio.sleep(HEARTBEAT_S)


@contextlib.asynccontextmanager
async def ground_station(config: Config, receive: Callable[[Any], None]) -> AsyncIterator[GroundStation]:
    """A station that is heard for as long as this lasts."""
    transport, station = await asyncio.get_running_loop().create_datagram_endpoint(
        lambda: GroundStation(receive), local_addr=config.mavlink.udp_addresses[0]
    )
    beating = asyncio.create_task(station.beat())
    try:
        yield station
    finally:
        beating.cancel()
        transport.close()


async def ros_node(config: Config, clock: Clock) -> RosGraph:
    """A node of the port's graph."""
    settings = config.ros2
    return await join_ros_graph(settings.listen, settings.domain_id, "bench", "watcher", clock)


class Watch:
    """Clients at the given ports, and the ages of what they received [s]: since it was measured aboard."""

    def __init__(self, config: Config, clock: Clock) -> None:
        self._config, self._clock, self._poses = config, clock, PoseStamps()
        self.ages_s: dict[str, list[float]] = {}

    async def run(self, ports: Sequence[str], driven_s: float) -> None:
        """Watch for so long."""
        clients: Mapping[str, Callable[[list[float]], Coroutine[Any, Any, None]]] = {
            "mavlink": self._mavlink, "ros2": self._ros2, "foxglove": self._foxglove, "nmea": self._nmea,
        }  # fmt: skip
        self.ages_s = {port: [] for port in ports}
        bus = await open_bus(self._config.bus, OBSERVER, self._clock)
        bus.on(keys.ODOMETRY, self._poses.note)
        try:
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(driven_s), asyncio.TaskGroup() as group:
                    for port in ports:
                        group.create_task(clients[port](self.ages_s[port]))
        finally:
            await bus.close()

    def _age_s(self, measured_us: float) -> float:
        return (self._clock.now_us() - measured_us) * 1e-6

    async def _mavlink(self, ages_s: list[float]) -> None:
        """ATTITUDE, by the pose that it is of: MAVLink's time is the boat's since it started."""

        def receive(message: Any) -> None:
            if message.get_type() == "ATTITUDE" and math.isfinite(message.yawspeed):
                measured_us = self._poses.measured_us(message.yawspeed)
                if measured_us is not None:
                    ages_s.append(self._age_s(measured_us))

        async with ground_station(self._config, receive):
            await asyncio.Event().wait()

    async def _ros2(self, ages_s: list[float]) -> None:
        """`odometry/global`, by its header; every other topic is subscribed to as well, pictures among them."""
        graph = await ros_node(self._config, self._clock)
        try:
            inboxes = {
                topic: graph.subscribe(topic.endpoint(self._config.bus.vessel), ROS_DEPTH) for topic in topics.SENT
            }
            while True:
                stamp = decode(await inboxes[topics.GLOBAL_ODOMETRY].get(), topics.GLOBAL_ODOMETRY.type).header.stamp
                ages_s.append(self._age_s(stamp.sec * 1e6 + stamp.nanosec * 1e-3))
        finally:
            await graph.close()

    async def _foxglove(self, ages_s: list[float]) -> None:
        """Our own JSON of the pose; every channel is subscribed to."""
        settings, odometry = self._config.foxglove, msgspec.json.Decoder(m.Odometry)
        scheme = "https" if settings.tls_pem else "http"
        names: dict[int, str] = {}
        async with (
            aiohttp.ClientSession() as http,
            http.ws_connect(
                f"{scheme}://{settings.host}:{settings.port}/", protocols=[FOXGLOVE_PROTOCOL], max_msg_size=0, ssl=False
            ) as socket,
        ):
            async for message in socket:
                if message.type is aiohttp.WSMsgType.TEXT:
                    words = msgspec.json.decode(message.data)
                    if words["op"] == "advertise":
                        new = {each["id"]: each["topic"] for each in words["channels"]}
                        names |= new
                        wanted = [{"id": number, "channelId": number} for number in new]
                        await socket.send_json({"op": "subscribe", "subscriptions": wanted})
                elif message.type is aiohttp.WSMsgType.BINARY:
                    opcode, number, _ = FOXGLOVE_HEAD.unpack_from(message.data)
                    if opcode == FOXGLOVE_DATA and names.get(number) == keys.ODOMETRY.name:
                        ages_s.append(self._age_s(odometry.decode(message.data[FOXGLOVE_HEAD.size :]).source_us))

    async def _nmea(self, ages_s: list[float]) -> None:
        """GGA, by its time of the day, in which hundredths are cut off."""
        reader, writer = await asyncio.open_connection(*tcp_address(self._config.nmea.listen))
        with contextlib.closing(writer):
            while line := (await reader.readline()).decode("ascii"):
                if (of_day_s := gga_time_s(line)) is not None:
                    ages_s.append((self._clock.now_us() * 1e-6 - of_day_s) % DAY_S)


def gga_time_s(line: str) -> float | None:
    """Seconds of the UTC day of a GGA sentence with a position; None for any other line."""
    fields = line.split(",")
    if not fields[0].endswith("GGA") or len(fields) < 2 or not fields[1]:
        return None
    return int(fields[1][:2]) * 3600.0 + int(fields[1][2:4]) * 60.0 + float(fields[1][4:])
