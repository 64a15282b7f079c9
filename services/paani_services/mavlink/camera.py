"""The boat's camera as a MAVLink component of its own: what it is, and where its stream is. Pure."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from paani.port_address import is_loopback
from paani_services.mavlink import commands
from paani_services.mavlink.codec import dialect
from paani_services.mavlink.fields import integer, to_int
from paani_services.mavlink.rtsp import PATH
from paani_services.mavlink.station import Source, Station

CAMERA_COMPONENT = dialect.MAV_COMP_ID_CAMERA
STREAM = 1
INFORMATION = dialect.MAVLINK_MSG_ID_CAMERA_INFORMATION
STREAM_INFORMATION = dialect.MAVLINK_MSG_ID_VIDEO_STREAM_INFORMATION
STREAM_STATUS = dialect.MAVLINK_MSG_ID_VIDEO_STREAM_STATUS
ASK_FOR = {  # commands that ask for one message that they name
    dialect.MAV_CMD_REQUEST_CAMERA_INFORMATION: INFORMATION,
    dialect.MAV_CMD_REQUEST_VIDEO_STREAM_INFORMATION: STREAM_INFORMATION,
    dialect.MAV_CMD_REQUEST_VIDEO_STREAM_STATUS: STREAM_STATUS,
}
NAME_BYTES, URI_BYTES = 32, 160
ANY_HOST = {"0.0.0.0", "::"}  # compared, not bound


class Stream(NamedTuple):
    """The pictures as RTSP serves them at `host` and `port`. size_px: width and height, None while not known."""

    host: str
    port: int
    rate_hz: float
    hfov_deg: float = 0.0
    size_px: tuple[int, int] | None = None


class Camera:
    """stream: the present state of the stream; None where there is none, and then there is no camera either."""

    def __init__(self, vessel: str, stream: Callable[[], Stream | None]) -> None:
        self._vessel, self._stream = vessel, stream

    def uri(self, station: Station) -> str:
        """Where this station can watch; empty where it cannot."""
        stream = self._stream()
        if stream is None or (is_loopback(stream.host) and not station.is_local):
            return ""
        host = station.own_host if stream.host in ANY_HOST else stream.host
        return f"rtsp://[{host}]:{stream.port}{PATH}" if ":" in host else f"rtsp://{host}:{stream.port}{PATH}"

    def send_heartbeat(self, station: Station, now_us: int) -> None:
        """To a station that can watch."""
        if self.uri(station):
            kind, none = dialect.MAV_TYPE_CAMERA, dialect.MAV_AUTOPILOT_INVALID
            message = dialect.MAVLink_heartbeat_message(kind, none, 0, 0, dialect.MAV_STATE_ACTIVE, 3)
            station.send(message, now_us, CAMERA_COMPONENT)

    def receive(self, station: Station, message: Any, source: Source, now_us: int, boot_ms: int) -> None:
        """Answer a command to the camera, which does nothing but say what it is."""
        if message.get_type() not in {"COMMAND_LONG", "COMMAND_INT"} or not self.uri(station):
            return
        command, wanted = message.command, ASK_FOR.get(message.command)
        if command == dialect.MAV_CMD_REQUEST_MESSAGE:
            wanted = integer(message.param1)
        found = self._messages(station, wanted, boot_ms)
        for each in found:
            station.send(each, now_us, CAMERA_COMPONENT)
        result = commands.ACCEPTED if found else commands.UNSUPPORTED
        acknowledgement = dialect.MAVLink_command_ack_message(command, result, 0, 0, *source)
        station.send(acknowledgement, now_us, CAMERA_COMPONENT)

    def _messages(self, station: Station, wanted: int | None, boot_ms: int) -> list[Any]:
        """What is sent for one; MAVSDK asks for the stream's status alone, and needs where it is as well."""
        stream = self._stream()
        if stream is None or wanted not in {INFORMATION, STREAM_INFORMATION, STREAM_STATUS}:
            return []
        width_px, height_px = stream.size_px or (0, 0)
        if wanted == INFORMATION:
            flags = dialect.CAMERA_CAP_FLAGS_HAS_VIDEO_STREAM
            names = b"PAANI".ljust(NAME_BYTES, b"\0"), self._vessel.encode("ascii", "replace")[:NAME_BYTES]
            return [
                dialect.MAVLink_camera_information_message(
                    boot_ms, list(names[0]), list(names[1].ljust(NAME_BYTES, b"\0")), 0, 0.0, 0.0, 0.0, width_px,
                    height_px, 0, flags, 0, b"",
                )
            ]  # fmt: skip
        running, hfov_deg = dialect.VIDEO_STREAM_STATUS_FLAGS_RUNNING, to_int(stream.hfov_deg, 0, 360)
        found = [
            dialect.MAVLink_video_stream_information_message(
                STREAM, 1, dialect.VIDEO_STREAM_TYPE_RTSP, running, stream.rate_hz, width_px, height_px, 0, 0, hfov_deg,
                b"camera", self.uri(station).encode("ascii", "replace")[:URI_BYTES],
                dialect.VIDEO_STREAM_ENCODING_UNKNOWN,
            )
        ]  # fmt: skip
        if wanted == STREAM_STATUS:
            found.append(
                dialect.MAVLink_video_stream_status_message(
                    STREAM, running, stream.rate_hz, width_px, height_px, 0, 0, hfov_deg
                )
            )
        return found
