"""One frame of a WebSocket, or of an answer about the past. Pure.

`u8 keylen | u16 headlen | key | header JSON | body`, integers big-endian.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable

import msgspec

PREFIX = struct.Struct(">BH")
LENGTH = struct.Struct(">I")
MAX_KEY_BYTES, MAX_HEADER_BYTES = 0xFF, 0xFFFF


class FrameHeader(msgspec.Struct, frozen=True, omit_defaults=True):
    """`age_ms`: time from the message's receipt until the frame was made. `picture`: a picture's header.

    `at_us`: the moment of the past that the frame belongs to [Unix us]; left out of a live one. `made_us`: when a live
    one was made, by a clock that is never set.
    """

    age_ms: int
    picture: msgspec.Raw = msgspec.Raw()
    at_us: int = 0
    made_us: int = 0


def encode_frame(key: str, header: FrameHeader, body: bytes) -> bytes:
    """The frame as bytes. Raises ValueError when key or header are too long for their length fields."""
    name, head = key.encode(), msgspec.json.encode(header)
    if len(name) > MAX_KEY_BYTES or len(head) > MAX_HEADER_BYTES:
        raise ValueError(f"{key}: key or header too long for a frame")
    return b"".join((PREFIX.pack(len(name), len(head)), name, head, body))


def pack_frames(frames: Iterable[bytes]) -> bytes:
    """Frames one after the other, each after its length."""
    return b"".join(part for frame in frames for part in (LENGTH.pack(len(frame)), frame))


def decode_frame(frame: bytes) -> tuple[str, FrameHeader, bytes]:
    """Inverse of `encode_frame`. Raises ValueError when the frame is cut or its header is not JSON."""
    if len(frame) < PREFIX.size:
        raise ValueError("frame shorter than its lengths")
    key_bytes, head_bytes = PREFIX.unpack_from(frame)
    start, end = PREFIX.size + key_bytes, PREFIX.size + key_bytes + head_bytes
    if len(frame) < end:
        raise ValueError("frame shorter than its key and header")
    header = msgspec.json.decode(frame[start:end], type=FrameHeader)
    return frame[PREFIX.size : start].decode(), header, frame[end:]
