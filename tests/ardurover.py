"""ArduPilot Rover itself, simulated: its program in a folder of its own, on a line that PAANI has, and one of ours.

Both lines are connections that the autopilot makes to this process, so that it opens no port for them.
"""

from __future__ import annotations

import asyncio
import contextlib
import functools
import os
import signal
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as dialect

from paani.clock import stopwatch_ms
from tests.at_work import at_work
from tests.mcu_peer import until

MANUAL, HOLD = 0, 4
NEUTRAL_US = 1500
GROUND_SYSTEM = 255
OUTPUTS_HZ = 20.0
# A boat with a motor on either side, at rest; no receiver, whose pulses the simulator would make up.
DEFAULTS = {
    "FRAME_CLASS": 2, "SERVO1_FUNCTION": 73, "SERVO3_FUNCTION": 74, "SERVO1_MIN": 1000, "SERVO1_MAX": 2000,
    "SERVO3_MIN": 1000, "SERVO3_MAX": 2000, "SERVO1_TRIM": 1500, "SERVO3_TRIM": 1500, "SIM_RC_FAIL": 1,
    "INS_ACCOFFS_X": 0.001, "INS_ACCOFFS_Y": 0.001, "INS_ACCOFFS_Z": 0.001,
    "INS_ACCSCAL_X": 1.001, "INS_ACCSCAL_Y": 1.001, "INS_ACCSCAL_Z": 1.001,
    "INS_ACC2OFFS_X": 0.001, "INS_ACC2OFFS_Y": 0.001, "INS_ACC2OFFS_Z": 0.001,
    "INS_ACC2SCAL_X": 1.001, "INS_ACC2SCAL_Y": 1.001, "INS_ACC2SCAL_Z": 1.001,
}  # fmt: skip


class Outputs(NamedTuple):
    """What goes to the motors, and when it was told."""

    at_ms: float
    left_us: int
    right_us: int


class ArduRover:
    """`line`: for PAANI. Everything else is seen and done by a ground station on the other line."""

    def __init__(self) -> None:
        self.line = ""
        self.outputs: list[Outputs] = []
        self.modes: list[tuple[float, int, bool]] = []  # when, mode, armed
        self.parameters: dict[str, float] = {}
        self.version = (0, 0, 0, 0)
        self._parser: Any = dialect.MAVLink(None, GROUND_SYSTEM, dialect.MAV_COMP_ID_MISSIONPLANNER)
        self._parser.robust_parsing = True
        self._far: dict[str, asyncio.StreamWriter] = {}
        self._servers: list[asyncio.Server] = []
        self._listeners: set[asyncio.Task[None]] = set()

    @property
    def mode(self) -> int:
        return self.modes[-1][1] if self.modes else -1

    @property
    def is_armed(self) -> bool:
        return bool(self.modes) and self.modes[-1][2]

    @property
    def thrust(self) -> tuple[float, float]:
        """Of both sides, from -1 to 1, as the motors are told it."""
        if not self.outputs:
            return 0.0, 0.0
        newest = self.outputs[-1]
        return (newest.left_us - NEUTRAL_US) / 500, (newest.right_us - NEUTRAL_US) / 500

    async def serve(self) -> tuple[int, int]:
        """Listen for the autopilot's two lines, and for PAANI; the ports of the autopilot's."""
        ports = []
        for name in ("vehicle", "ground", "paani"):
            server = await asyncio.start_server(functools.partial(self._take, name), "127.0.0.1", 0)
            self._servers.append(server)
            ports.append(server.sockets[0].getsockname()[1])
        self.line = f"socket://127.0.0.1:{ports[2]}"
        return ports[0], ports[1]

    async def close(self) -> None:
        for server in self._servers:
            server.close()
        for writer in self._far.values():
            writer.close()

    async def beat(self) -> None:
        """A ground station's heartbeat, which is none of PAANI's."""
        while True:
            self.send(dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3))
            await asyncio.sleep(1.0)

    def send(self, message: Any) -> None:
        """As the ground station."""
        if writer := self._far.get("ground"):
            writer.write(bytes(message.pack(self._parser)))
            self._parser.seq = (self._parser.seq + 1) % 256

    def command(self, number: int, *values: float) -> None:
        """COMMAND_LONG of the ground station."""
        filled = [*values, *[0.0] * (7 - len(values))]
        self.send(dialect.MAVLink_command_long_message(1, 1, number, 0, *filled))

    def set_mode(self, mode: int) -> None:
        self.command(dialect.MAV_CMD_DO_SET_MODE, dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, mode)

    def disarm(self) -> None:
        self.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 0)

    async def read_parameter(self, name: str) -> float:
        self.parameters.pop(name, None)
        async with asyncio.timeout(10.0):
            while name not in self.parameters:
                self.send(dialect.MAVLink_param_request_read_message(1, 1, name.encode(), -1))
                await asyncio.sleep(0.1)
        return self.parameters[name]

    async def get_ready(self) -> None:
        """Wait until it speaks, and have it tell its outputs and its version."""
        await until(lambda: bool(self.modes), 60.0)
        outputs = dialect.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW
        self.command(dialect.MAV_CMD_SET_MESSAGE_INTERVAL, outputs, 1e6 / OUTPUTS_HZ)
        self.command(dialect.MAV_CMD_SET_MESSAGE_INTERVAL, dialect.MAVLINK_MSG_ID_HEARTBEAT, 1e5)
        self.command(dialect.MAV_CMD_REQUEST_MESSAGE, dialect.MAVLINK_MSG_ID_AUTOPILOT_VERSION)
        await until(lambda: bool(self.outputs) and any(self.version), 20.0)

    async def _take(self, name: str, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._far[name] = writer
        with contextlib.suppress(OSError):
            while data := await reader.read(4096):
                match name:
                    case "ground":
                        for message in self._parser.parse_buffer(data) or ():
                            self._hear(message)
                    case "vehicle":
                        self._pass(data, "paani")
                    case _:
                        self._pass(data, "vehicle")
        if self._far.get(name) is writer:
            del self._far[name]
        writer.close()

    def _pass(self, data: bytes, to: str) -> None:
        if writer := self._far.get(to):
            writer.write(data)

    def _hear(self, message: Any) -> None:
        now_ms = stopwatch_ms()
        match message.get_type():
            case "HEARTBEAT" if message.get_srcComponent() == 1:
                state = (message.custom_mode, bool(message.base_mode & dialect.MAV_MODE_FLAG_SAFETY_ARMED))
                if not self.modes or self.modes[-1][1:] != state:
                    self.modes.append((now_ms, *state))
            case "SERVO_OUTPUT_RAW":
                self.outputs.append(Outputs(now_ms, message.servo1_raw, message.servo3_raw))
            case "PARAM_VALUE":
                self.parameters[message.param_id] = message.param_value
            case "AUTOPILOT_VERSION":
                word = message.flight_sw_version
                self.version = (word >> 24, word >> 16 & 255, word >> 8 & 255, word & 255)
            case _:
                pass


@contextlib.asynccontextmanager
async def ardurover(program: Path, folder: Path, **parameters: float) -> AsyncIterator[ArduRover]:
    """The autopilot of a boat, ready, with these parameters beside `DEFAULTS`."""
    rover = ArduRover()
    vehicle, ground = await rover.serve()
    defaults = folder / "boat.parm"
    lines = "".join(f"{name} {value}\n" for name, value in (DEFAULTS | parameters).items())
    await asyncio.to_thread(defaults.write_text, lines)
    instance = str(10 + os.getpid() % 200)  # which has ports of its own, for what nobody here uses
    words = ["-w", "--model", "motorboat-skid", "--speedup", "1", "--home", "59.3293,18.0686,0,0", "-I", instance,
             "--defaults", str(defaults), "--serial0", f"tcpclient:127.0.0.1:{vehicle}",
             "--serial1", f"tcpclient:127.0.0.1:{ground}", "--serial2", "none"]  # fmt: skip
    with (folder / "ardurover.log").open("wb") as log:
        process = await asyncio.create_subprocess_exec(program, *words, cwd=folder, stdout=log, stderr=log)
    try:
        async with at_work(rover.beat()):
            await rover.get_ready()
            yield rover
    finally:
        if process.returncode is None:
            process.send_signal(signal.SIGKILL)
        await process.wait()
        await rover.close()
