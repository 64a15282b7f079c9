"""An ArduPilot Rover by the book, at the end of a TCP line: frames by pymavlink's dialect `ardupilotmega`."""

from __future__ import annotations

import asyncio
import contextlib
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

from paani.clock import stopwatch_ms
from tests.rover_by_the_book import STICKS


class RoverPeer:
    """Does what it is told by the system in its `SYSID_MYGCS`, and keeps the sticks that it was sent."""

    def __init__(self) -> None:
        self.parameters = {
            "SYSID_MYGCS": 255.0, "RC_OVERRIDE_TIME": 3.0, "FS_THR_ENABLE": 1.0, "FS_GCS_ENABLE": 0.0,
            "FS_GCS_TIMEOUT": 5.0, "FS_TIMEOUT": 1.5, "FS_ACTION": 0.0,
            "PILOT_STEER_TYPE": 1.0, "MANUAL_STR_EXPO": 0.2, "MOT_SLEWRATE": 100.0, "MOT_THR_MIN": 10.0,
            **STICKS,
        }  # fmt: skip
        self.read_only: set[str] = set()
        self.mode, self.is_armed, self.is_silent = 4, False, False
        self.sticks: list[tuple[float, int, int]] = []
        self.orders_to_arm = 0
        self._parser: Any = dialect.MAVLink(None, 1, 1)
        self._parser.robust_parsing = True
        self._writers: set[asyncio.StreamWriter] = set()
        self._server: asyncio.Server | None = None

    async def open(self) -> str:
        """Listen; the address of the line."""
        self._server = await asyncio.start_server(self._serve, "127.0.0.1", 0)
        return f"socket://127.0.0.1:{self._server.sockets[0].getsockname()[1]}"

    def drop_line(self) -> None:
        """End every connection."""
        for writer in self._writers:
            writer.transport.abort()

    async def close(self) -> None:
        if self._server is not None:
            self._server.close()
        self.drop_line()

    async def beat(self) -> None:
        """A heartbeat a second."""
        while True:
            if not self.is_silent:
                self._send(dialect.MAVLink_heartbeat_message(11, 3, 128 * self.is_armed | 1, self.mode, 4, 3))
            await asyncio.sleep(1.0)

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._writers.add(writer)
        with contextlib.suppress(OSError):
            while data := await reader.read(4096):
                for message in self._parser.parse_buffer(data) or ():
                    self._obey(message)
        self._writers.discard(writer)
        writer.close()

    def _send(self, message: Any) -> None:
        frame = message.pack(self._parser)
        for writer in self._writers:
            writer.write(frame)

    def _answer(self, name: str) -> None:
        if name in self.parameters:
            self._send(dialect.MAVLink_param_value_message(name.encode(), self.parameters[name], 9, 7, 0))

    def _obey(self, message: Any) -> None:
        match message.get_type():
            case "PARAM_REQUEST_READ":
                self._answer(message.param_id)
            case "PARAM_SET" if message.param_id in self.parameters:
                if message.param_id not in self.read_only:
                    self.parameters[message.param_id] = message.param_value
                self._answer(message.param_id)
            case "MANUAL_CONTROL" if message.get_srcSystem() == self.parameters["SYSID_MYGCS"]:
                self.sticks.append((stopwatch_ms(), message.z, message.y))
            case "COMMAND_LONG" if message.command == dialect.MAV_CMD_DO_SET_MODE:
                self.mode = int(message.param2)
            case "COMMAND_LONG" if message.command == dialect.MAV_CMD_COMPONENT_ARM_DISARM:
                self.orders_to_arm += message.param1 == 1
                self.is_armed = message.param1 == 1
                self._send(dialect.MAVLink_command_ack_message(message.command, 0))
            case _:
                pass
