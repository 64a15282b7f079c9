"""Programs of others at the published ports of containers: what each hears of a boat adrift."""

from __future__ import annotations

import asyncio
import contextlib

import aiohttp
import msgspec
from pymavlink.dialects.v20 import common
from pynmeagps import NMEAReader

from paani.keys import PORTS
from paani_services.ros2.topics import GLOBAL_ODOMETRY
from tests.conftest import find_free_port
from tests.integration.test_ros2 import joined

HOST = "127.0.0.1"
LIMIT_S = 60.0
FOXGLOVE = "foxglove.sdk.v1"


class Doors:
    """A free port of this machine for each, as `environment` tells Compose."""

    def __init__(self) -> None:
        self.ports = {name: find_free_port() for name in PORTS}
        self.environment = {f"PAANI_{name.upper()}_PORT": str(port) for name, port in self.ports.items()}

    async def require_all_speak(self) -> None:
        """Each tells of the boat in its own words. Fails, after `LIMIT_S`, where one does not."""
        async with asyncio.timeout(LIMIT_S), asyncio.TaskGroup() as group:
            for hear in (self._hear_nmea, self._hear_mavlink, self._hear_foxglove, self._hear_ros2):
                group.create_task(hear())

    async def _hear_nmea(self) -> None:
        """A position that holds."""
        reader, writer = await asyncio.open_connection(HOST, self.ports["nmea"])
        with contextlib.closing(writer):
            while b"RMC" not in (line := await reader.readline()) or NMEAReader.parse(line, validate=1).status != "A":
                assert line

    async def _hear_mavlink(self) -> None:
        """A boat; and one that obeys nobody who comes through this door without the key."""
        station = common.MAVLink(None, srcSystem=255, srcComponent=190)
        disarm = common.MAV_CMD_COMPONENT_ARM_DISARM, 0, 0.0, *[0.0] * 6
        reader, writer = await asyncio.open_connection(HOST, self.ports["mavlink"])
        present, answer = False, None
        with contextlib.closing(writer):
            writer.write(common.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3).pack(station))
            writer.write(common.MAVLink_command_long_message(1, 1, *disarm).pack(station))
            while not present or answer is None:
                for message in station.parse_buffer(await reader.read(4096)) or ():
                    if message.get_type() == "HEARTBEAT":
                        present = message.type == common.MAV_TYPE_SURFACE_BOAT
                    elif message.get_type() == "COMMAND_ACK":
                        answer = message.result
        assert answer != common.MAV_RESULT_ACCEPTED

    async def _hear_foxglove(self) -> None:
        """What it offers."""
        url = f"http://{HOST}:{self.ports['foxglove']}/"
        async with (
            aiohttp.ClientSession() as http,
            http.ws_connect(url, protocols=[FOXGLOVE], max_msg_size=0) as socket,
        ):
            offered = set[str]()
            async for message in socket:
                if message.type is aiohttp.WSMsgType.TEXT:
                    words = msgspec.json.decode(message.data)
                    offered |= {channel["topic"] for channel in words.get("channels", ())}
                if any("odometry" in topic for topic in offered):
                    break
            assert offered

    async def _hear_ros2(self) -> None:
        """An estimate, by a node that has the router alone."""
        async with joined(self.ports["ros2"], GLOBAL_ODOMETRY, mode="client") as node:
            await node.until(lambda: bool(node.heard), "odometry")
