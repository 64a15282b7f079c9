"""MAVLink 2 frames to messages and back, by the dialect `common` of pymavlink.

Messages are pymavlink's: `message.id`, `message.get_type()`, and the fields of the dialect by their names.
"""

from __future__ import annotations

from typing import Any

from pymavlink.dialects.v20 import common as dialect

from paani_services.mavlink.signing import Signer

__all__ = ["COMPONENT", "HEARTBEAT", "SYSTEM", "Codec", "dialect", "text_of"]

SYSTEM, COMPONENT = 1, 1  # an autopilot of a single vehicle
HEARTBEAT = 0
CHUNK_BYTES = 4096  # parsed at a time; less than a frame of it, 280 bytes, waits for the next


class _Parser(dialect.MAVLink):  # type: ignore[misc]  # pymavlink has no types
    """The dialect's parser, with the signature checked by our signer.

    The dialect's own check notes the stamp of a frame before it knows who wrote it: a forged one of the far future
    would shut out its station.
    """

    def __init__(self, signer: Signer | None) -> None:
        super().__init__(None, SYSTEM, COMPONENT)
        self.robust_parsing = True
        self.signer = signer
        if signer is not None:
            self.signing.secret_key = signer.key
            self.signing.sign_outgoing = True
            self.signing.allow_unsigned_callback = lambda _, message_id: message_id == HEARTBEAT

    def check_signature(self, msgbuf: bytearray, srcSystem: int, srcComponent: int) -> bool:  # theirs
        return self.signer is not None and self.signer.is_authentic(bytes(msgbuf), srcSystem, srcComponent)


class Codec:
    """One link. link_id: of its signatures, its own among the links of this process.

    `damaged` counts frames that could not be read or were not signed as they must be, and runs of bytes that are none.
    """

    def __init__(self, link_id: int, signer: Signer | None) -> None:
        self._parser = _Parser(signer)
        self._parser.signing.link_id = link_id % 256
        self._sequences: dict[int, int] = {}  # of frames, by component
        self.damaged = 0

    def decode(self, data: bytes) -> list[Any]:
        """The messages that these bytes complete, in order; unknown ones are left out."""
        messages = []
        for at in range(0, len(data), CHUNK_BYTES):
            for message in self._parser.parse_buffer(data[at : at + CHUNK_BYTES]) or ():
                kind = message.get_type()
                self.damaged += kind == "BAD_DATA"
                if kind != "BAD_DATA" and not kind.startswith("UNKNOWN_"):
                    messages.append(message)
            # The parser keeps what it has read until nothing at all is left over: drop it here.
            self._parser.buf = self._parser.buf[self._parser.buf_index :]
            self._parser.buf_index = 0
        return messages

    def encode(self, message: Any, now_us: int, component: int = COMPONENT) -> bytes:
        """One frame of this component, signed where there is a key."""
        parser = self._parser
        parser.srcComponent, parser.seq = component, self._sequences.get(component, 0)
        if parser.signer is not None:
            parser.signing.timestamp = parser.signer.next_stamp(now_us)
        frame = bytes(message.pack(parser))
        self._sequences[component] = (parser.seq + 1) % 256
        return frame


def text_of(field: bytes | str) -> str:
    """The text of a field of characters."""
    return field if isinstance(field, str) else field.decode("ascii", "replace")
