"""A ground station for tests: the parser of pymavlink decodes what the port sends and encodes what is sent to it."""

from __future__ import annotations

import math
from typing import Any

from pymavlink.dialects.v20 import common

from paani import messages as m
from paani.config import AdvisorConfig
from paani_services.mavlink.camera import Camera, Stream
from paani_services.mavlink.codec import Codec
from paani_services.mavlink.gateway import Gateway, Request
from paani_services.mavlink.mission_exchange import MissionOrder
from paani_services.mavlink.parameter_exchange import ParameterWrite
from paani_services.mavlink.signing import Signer
from paani_services.mavlink.snapshot import Snapshot
from paani_services.mavlink.station import Station

NOW_US = 1_795_568_000_000_000
STATION = (255, 190)  # as ground stations name themselves
ORIGIN_DEG = (50.1072, 8.6928)
HEARTBEAT = common.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3)


def odometry(**changes: Any) -> m.Odometry:
    """A boat 10 m east and 20 m north of the origin that heads 30 degrees north of east at 1 m/s."""
    fields = {
        "source_us": NOW_US, "x_m": 10.0, "y_m": 20.0, "yaw_rad": math.radians(30.0), "surge_mps": 1.0,
        "healthy": True, "latitude_deg": ORIGIN_DEG[0] + 20.0 / 111_230.0,
        "longitude_deg": ORIGIN_DEG[1] + 10.0 / 71_500.0,
    }  # fmt: skip
    return m.Odometry(**{**fields, **changes})


def in_order(**changes: Any) -> Snapshot:
    """A boat that is in order, not armed, and could be."""
    fields: dict[str, Any] = {
        "now_us": NOW_US,
        "boot_ms": 5000,
        "odometry": odometry(),
        "inertial": odometry(),
        "fix": m.GpsFix(
            source_us=NOW_US, latitude_deg=50.5, longitude_deg=-8.25, sog_mps=1.5, cog_rad=0.0, position_std_m=0.8
        ),
        "operator": m.OperatorState(source_us=NOW_US, armed=False, stopped=False),
        "applied": m.ThrustApplied(
            source_us=NOW_US, left=0.0, right=0.0, left_n=0.0, right_n=0.0, zero_cause=m.ZeroCause.NOT_ARMED
        ),
        "command": m.NavCommand(
            source_us=NOW_US, enable=False, heading_rad=0.0, speed_mps=0.0, inhibits=(m.Inhibit.NOT_ARMED,)
        ),
        "advisory": m.Advisory(source_us=NOW_US, direction=m.Direction.STRAIGHT, reason=m.Reason.CENTER_CLEAR),
    }
    return Snapshot(**{**fields, **changes})


def armed(**changes: Any) -> Snapshot:
    """The same boat, armed and under way."""
    return in_order(
        **{
            "operator": m.OperatorState(source_us=NOW_US, armed=True, stopped=False, by="dashboard"),
            "command": m.NavCommand(source_us=NOW_US, enable=True, heading_rad=0.5, speed_mps=0.6),
            "applied": m.ThrustApplied(
                source_us=NOW_US, left=0.1, right=0.1, left_n=7.5, right_n=7.5, zero_cause=m.ZeroCause.NONE
            ),
            **changes,
        }
    )


class Peer:
    """One station at a gateway: what it has been sent, by pymavlink's parser."""

    def __init__(self, gateway: Gateway, link_id: int = 0, *, signer: Signer | None = None, local: bool = True) -> None:
        self._parser = common.MAVLink(None, *STATION)
        self._parser.robust_parsing = True
        self.frames: list[bytes] = []
        self.station = Station(f"peer {link_id}", Codec(link_id, signer), self.frames.append, is_local=local)
        self._gateway = gateway
        gateway.stations.append(self.station)

    def pack(self, message: Any, system: int = STATION[0]) -> bytes:
        """The frame of a message of this station."""
        sender = common.MAVLink(None, system, STATION[1])
        return bytes(message.pack(sender))

    def send(self, message: Any, now_us: int = NOW_US) -> list[Any]:
        """Send one message; what has been sent back at once."""
        return self.send_bytes(self.pack(message), now_us)

    def send_bytes(self, data: bytes, now_us: int = NOW_US) -> list[Any]:
        self.frames.clear()
        self._gateway.receive(self.station, data, now_us)
        return self.received()

    def received(self) -> list[Any]:
        """Everything since the last look."""
        messages = self._parser.parse_buffer(b"".join(self.frames)) or []
        self.frames.clear()
        assert all(message.get_type() != "BAD_DATA" for message in messages)
        return list(messages)

    def command(self, command: int, *parameters: float, now_us: int = NOW_US, target: int = 1) -> list[Any]:
        """Send COMMAND_LONG."""
        seven = [*parameters, *[math.nan] * (7 - len(parameters))]
        return self.send(common.MAVLink_command_long_message(target, 1, command, 0, *seven), now_us)


class Port:
    """A gateway without links, what it has asked of the operator's process, and what it has counted."""

    def __init__(self, snapshot: Snapshot, *, is_signed: bool = False) -> None:
        self.asked: list[Request] = []
        self.sent: list[MissionOrder] = []
        self.counted: list[str] = []
        self.written: list[ParameterWrite] = []
        self.driven: list[tuple[float, float, int]] = []

        def drive(surge: float, turn: float, hand: int) -> None:
            self.driven.append((surge, turn, hand))

        self.stream: Stream | None = None
        self.gateway = Gateway(
            self.asked.append, self.sent.append, drive, self.written.append, self.counted.append,
            Camera("otter", lambda: self.stream), advisor=AdvisorConfig(), cruise_mps=0.6, is_signed=is_signed,
        )  # fmt: skip
        self.gateway.tick(snapshot)


def kinds(messages: list[Any]) -> list[str]:
    """Names of messages."""
    return [message.get_type() for message in messages]


def only(messages: list[Any], kind: str) -> Any:
    """The one message of this kind; fails where there is none, or more."""
    (found,) = [message for message in messages if message.get_type() == kind]
    return found
