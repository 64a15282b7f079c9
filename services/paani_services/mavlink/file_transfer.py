"""MAVFTP: there are no files, and a station is told so at once instead of asking for eleven seconds. Pure."""

from __future__ import annotations

from typing import Any

from paani_services.mavlink.codec import COMPONENT, SYSTEM, dialect

NAK, FILE_NOT_FOUND = 129, 10
PAYLOAD_BYTES = 251


def refuse_file(request: Any) -> Any | None:
    """The refusal of one request (https://mavlink.io/en/services/ftp.html#payload); None where none is due."""
    payload = bytes(request.payload)
    if request.target_system != SYSTEM or request.target_component not in {0, COMPONENT} or payload[3] == NAK:
        return None
    seq = (int.from_bytes(payload[0:2], "little") + 1) % 65_536
    header = seq.to_bytes(2, "little") + bytes((payload[2], NAK, 1, payload[3], 0, 0, 0, 0, 0, 0, FILE_NOT_FOUND))
    return dialect.MAVLink_file_transfer_protocol_message(
        0, request.get_srcSystem(), request.get_srcComponent(), list(header.ljust(PAYLOAD_BYTES, b"\0"))
    )
