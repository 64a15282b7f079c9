"""MessagePack-RPC as the board's router speaks it: values back to back, with no length before them.

Found by their constant heads in whatever stream: cut, mixed with junk, or damaged. A message counts as whole only if it
has one of the three shapes and each of its bins ends with its CRC; otherwise the search goes on one byte further, so
that a damaged length swallows no message behind it.
"""

from __future__ import annotations

import re
from typing import Any, Final

import msgspec

from paani.microcontroller.payloads import has_valid_crc
from paani.undecodable import UNDECODABLE

MAX_MESSAGE_BYTES = 256  # the sketch's library takes no longer ones
MAX_DEPTH = 4  # a message holds parameters, an error its code and text
REQUEST, RESPONSE, NOTIFICATION = 0, 1, 2
HEAD = re.compile(rb"\x94[\x00\x01]|\x93\x02")  # arrays of four or three, and the type
INCOMPLETE: Final = -1
MALFORMED: Final = -2


class Request(msgspec.Struct, frozen=True):
    """A call that wants an answer."""

    id: int
    method: str
    params: tuple[Any, ...]


class Response(msgspec.Struct, frozen=True):
    """The answer to a call. `error` is empty, or the text that says why there is no result."""

    id: int
    error: str
    error_code: int
    result: Any


class Notification(msgspec.Struct, frozen=True):
    """A call that wants no answer."""

    method: str
    params: tuple[Any, ...]


RpcMessage = Request | Response | Notification


def encode_request(call_id: int, method: str, *params: Any) -> bytes:
    return msgspec.msgpack.encode([REQUEST, call_id, method, list(params)])


def encode_response(call_id: int, result: Any) -> bytes:
    return msgspec.msgpack.encode([RESPONSE, call_id, None, result])


def encode_notification(method: str, *params: Any) -> bytes:
    return msgspec.msgpack.encode([NOTIFICATION, method, list(params)])


class MessageScanner:
    """Finds messages in a stream. `junk_bytes`: received, and part of none; `bad_crc`: messages but for their CRC."""

    def __init__(self) -> None:
        self._buffer = bytearray()
        self.junk_bytes = 0
        self.bad_crc = 0

    def feed(self, data: bytes) -> list[RpcMessage]:
        """The messages completed by these bytes, in the order they came. Never raises, whatever the bytes."""
        self._buffer += data
        buffer, messages = bytes(self._buffer), list[RpcMessage]()
        taken = 0  # everything before is dealt with
        start = waiting = _find_head(buffer, 0)
        is_waiting = False
        while start < len(buffer):
            end = find_end(buffer, start)
            message = self._read(buffer[start:end]) if end > 0 else None
            if message is not None:
                messages.append(message)
                self.junk_bytes += start - taken
                taken, is_waiting = end, False
                start = waiting = _find_head(buffer, end)
                continue
            if end == INCOMPLETE and not is_waiting:
                waiting, is_waiting = start, True  # unless a whole message follows, this one is still arriving
            start = _find_head(buffer, start + 1)
            if not is_waiting:
                waiting = start
        self.junk_bytes += waiting - taken
        self._buffer = self._buffer[waiting:]
        return messages

    def _read(self, data: bytes) -> RpcMessage | None:
        try:
            fields = msgspec.msgpack.decode(data)
        except UNDECODABLE:
            return None
        message = _message_of(fields)
        if message is not None and not all(has_valid_crc(payload) for payload in _bins(fields)):
            self.bad_crc += 1
            return None
        return message


def find_end(data: bytes, start: int) -> int:
    """Where the value that begins at `start` ends, INCOMPLETE, or MALFORMED (too long and too deep ones as well)."""
    return _skip(data, start, min(len(data), start + MAX_MESSAGE_BYTES), start + MAX_MESSAGE_BYTES, MAX_DEPTH)


def _skip(data: bytes, at: int, end: int, limit: int, depth: int) -> int:
    """As `find_end`: `end` bounds what is there, `limit` what a message may reach."""
    if at >= end:
        return INCOMPLETE if at < limit else MALFORMED
    code = data[at]
    at += 1
    length = items = 0
    match code:
        case _ if code <= 0x7F or code >= 0xE0 or code in {0xC0, 0xC2, 0xC3}:
            pass
        case _ if 0x80 <= code <= 0x8F:
            items = 2 * (code & 0x0F)
        case _ if 0x90 <= code <= 0x9F:
            items = code & 0x0F
        case _ if 0xA0 <= code <= 0xBF:
            length = code & 0x1F
        case _ if code in FIXED_BYTES:
            length = FIXED_BYTES[code]
        case _ if code in COUNTED:
            width, counts_bytes, extra = COUNTED[code]
            if at + width > end:
                return INCOMPLETE if at + width <= limit else MALFORMED
            count = int.from_bytes(data[at : at + width], "big")
            at += width
            length, items = (count + extra, 0) if counts_bytes else (0, count * extra)
        case _:
            return MALFORMED
    if at + length > limit or items > limit - at or (items and depth == 0):
        return MALFORMED
    at += length
    for _ in range(items):
        at = _skip(data, at, end, limit, depth - 1)
        if at < 0:
            return at
    return at if at <= end else INCOMPLETE


# Bytes that follow the code of a value of fixed size: floats, integers, fixed extensions with their type.
FIXED_BYTES = {0xCA: 4, 0xCB: 8} | {0xCC + i: 1 << i for i in range(4)} | {0xD0 + i: 1 << i for i in range(4)}
FIXED_BYTES |= {0xD4 + i: 1 + (1 << i) for i in range(5)}
# Width of the count; whether it counts bytes; bytes beside them (an extension's type), or values per item.
COUNTED = {
    **{0xC4 + i: (1 << i, True, 0) for i in range(3)},  # bin
    **{0xC7 + i: (1 << i, True, 1) for i in range(3)},  # extension
    **{0xD9 + i: (1 << i, True, 0) for i in range(3)},  # text
    **{0xDC + i: (2 << i, False, 1) for i in range(2)},  # array
    **{0xDE + i: (2 << i, False, 2) for i in range(2)},  # map
}


def _find_head(data: bytes, start: int) -> int:
    """Where the next message may begin; a first byte at the end of the data may be one."""
    match = HEAD.search(data, start)
    if match is not None:
        return match.start()
    return len(data) - (len(data) > start and data[-1] in b"\x93\x94")


def _message_of(fields: Any) -> RpcMessage | None:
    """The message in these fields, or None. One that holds another is the beginning of a message that was cut off."""
    match fields:
        case [0, int(call_id), str(method), list(params)] if call_id >= 0 and _are_plain(params):
            return Request(call_id, method, tuple(params))
        case [1, int(call_id), None, result] if call_id >= 0 and _are_plain([result]):
            return Response(call_id, "", 0, result)
        case [1, int(call_id), [int(code), str(text)], None] if call_id >= 0:
            return Response(call_id, text or "no reason given", code, None)
        case [2, str(method), list(params)] if _are_plain(params):
            return Notification(method, tuple(params))
    return None


def _are_plain(values: list[Any]) -> bool:
    is_plain = all(value is None or isinstance(value, bool | int | float | str | bytes) for value in values)
    return is_plain and _message_of(values) is None


def _bins(value: Any) -> list[bytes]:
    match value:
        case bytes():
            return [value]
        case list():
            return [payload for item in value for payload in _bins(item)]
    return []
