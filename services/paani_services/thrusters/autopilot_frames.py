"""MAVLink 2 frames of the conversation with an autopilot, by pymavlink's dialect `common`."""

from __future__ import annotations

from typing import Any

from pymavlink.dialects.v20 import common as dialect

from paani_services.thrusters.autopilot import (
    Autopilot,
    Beat,
    Command,
    Heartbeat,
    Order,
    ReadParameter,
    WriteParameter,
)
from paani_services.thrusters.autopilot_sticks import Sticks

AUTOPILOT_COMPONENT = dialect.MAV_COMP_ID_AUTOPILOT1
OWN_COMPONENT = dialect.MAV_COMP_ID_ONBOARD_COMPUTER
UNUSED_AXIS = 0x7FFF
DONE = (dialect.MAV_RESULT_ACCEPTED, dialect.MAV_RESULT_IN_PROGRESS)
CHUNK_BYTES = 4096  # parsed at a time


class AutopilotFrames:
    """One line. What others send on it than the autopilot of this number is passed over."""

    def __init__(self, system: int, own_system: int) -> None:
        self._system = system
        self._parser: Any = dialect.MAVLink(None, own_system, OWN_COMPONENT)
        self._parser.robust_parsing = True
        self.damaged = 0

    def decode(self, data: bytes, autopilot: Autopilot, now_ms: float) -> None:
        """Pass on what these bytes complete."""
        for at in range(0, len(data), CHUNK_BYTES):
            for message in self._parser.parse_buffer(data[at : at + CHUNK_BYTES]) or ():
                kind = message.get_type()
                self.damaged += kind == "BAD_DATA"
                is_its_own = (message.get_srcSystem(), message.get_srcComponent()) == (
                    self._system,
                    AUTOPILOT_COMPONENT,
                )
                if kind != "BAD_DATA" and is_its_own:
                    _pass_on(message, kind, autopilot, now_ms)
            # The parser keeps what it has read until nothing at all is left over: drop it here.
            self._parser.buf = self._parser.buf[self._parser.buf_index :]
            self._parser.buf_index = 0

    def encode(self, order: Order) -> bytes:
        """One frame."""
        frame = bytes(self._message(order).pack(self._parser))
        self._parser.seq = (self._parser.seq + 1) % 256
        return frame

    def _message(self, order: Order) -> Any:
        target = (self._system, AUTOPILOT_COMPONENT)
        match order:
            case Beat():
                return dialect.MAVLink_heartbeat_message(
                    dialect.MAV_TYPE_ONBOARD_CONTROLLER,
                    dialect.MAV_AUTOPILOT_INVALID,
                    0,
                    0,
                    dialect.MAV_STATE_ACTIVE,
                    3,
                )
            case Sticks(ahead, starboard):
                return dialect.MAVLink_manual_control_message(
                    self._system, UNUSED_AXIS, starboard, ahead, UNUSED_AXIS, 0
                )
            case Command(number, first, second):
                return dialect.MAVLink_command_long_message(*target, number, 0, first, second, 0, 0, 0, 0, 0)
            case ReadParameter(name):
                return dialect.MAVLink_param_request_read_message(*target, name.encode(), -1)
            case WriteParameter(name, value):
                return dialect.MAVLink_param_set_message(*target, name.encode(), value, dialect.MAV_PARAM_TYPE_REAL32)


def _pass_on(message: Any, kind: str, autopilot: Autopilot, now_ms: float) -> None:
    match kind:
        case "HEARTBEAT":
            is_armed = bool(message.base_mode & dialect.MAV_MODE_FLAG_SAFETY_ARMED)
            autopilot.receive_heartbeat(
                Heartbeat(message.type, message.autopilot, message.custom_mode, is_armed), now_ms
            )
        case "PARAM_VALUE":
            autopilot.receive_parameter(message.param_id.rstrip("\0"), message.param_value)
        case "COMMAND_ACK" if message.result not in DONE:
            autopilot.receive_refusal(message.command, now_ms)
        case "STATUSTEXT":
            autopilot.receive_text(message.text.rstrip("\0"))
        case _:
            pass
