"""Frames of a byte stream that comes in chunks: NMEA 0183 sentences and UBX messages, also mixed on one line. Pure."""

import functools
import operator
import re
from enum import StrEnum
from typing import NamedTuple

from pyubx2 import UBX_HDR, isvalid_checksum

# The standard allows 82 characters, but receivers write more: VectorNav's 9-axis sentence has about 120.
MAX_SENTENCE = 160
MAX_UBX_PAYLOAD = 1024  # NAV-SAT of 80 satellites has 968 bytes; a longer one is noise that looks like a header
_START = re.compile(rb"[$!\xb5]")
_BODY = re.compile(rb"[$!][\x20\x22\x23\x25-\x7e]*")  # printable characters up to the end or the next start

_SENTENCE = re.compile(rb"[$!]([\x20\x22\x23\x25-\x29\x2b-\x7e]+)\*([0-9A-Fa-f]{2})\r?\n")
_UBX = re.compile(re.escape(UBX_HDR) + rb"..(..)", re.DOTALL)


class Protocol(StrEnum):
    """What a frame is written in."""

    NMEA = "NMEA"
    UBX = "UBX"


class Frame(NamedTuple):
    """One whole frame. The checksum of a UBX message is verified, that of a sentence is not yet."""

    protocol: Protocol
    data: bytes


class Framer:
    """Cuts frames out of the bytes it is fed; keeps at most one unfinished frame.

    What cannot be a frame is skipped up to the next byte that may begin one, so that a false start hides nothing after
    it. A UBX message that is unfinished, and has a whole frame within, is such a false start.
    """

    def __init__(self) -> None:
        self._waiting = bytearray()
        self.cut_sentences = 0
        """Sentences that were broken off, too long, or held bytes that no sentence has."""
        self.ubx_failures = 0
        """UBX headers whose checksum did not fit what followed."""

    def feed(self, data: bytes) -> list[Frame]:
        """The frames that end within `data`."""
        self._waiting += data
        frames = []
        while (frame := self._cut()) is not None:
            frames.append(frame)
        return frames

    def _cut(self) -> Frame | None:
        """The next whole frame; None until more bytes come."""
        while (start := _START.search(self._waiting)) is not None:
            del self._waiting[: start.start()]
            if self._waiting[0] == UBX_HDR[0]:
                size = self._ubx_size()
                if size == 0:
                    return None
                if size > 0:
                    return self._take(Protocol.UBX, size)
            else:
                size = self._sentence_size()
                if size == 0:
                    return None
                if size > 0:
                    return self._take(Protocol.NMEA, size)
        self._waiting.clear()
        return None

    def _take(self, protocol: Protocol, size: int) -> Frame:
        frame = Frame(protocol, bytes(self._waiting[:size]))
        del self._waiting[:size]
        return frame

    def _skip(self, size: int) -> int:
        del self._waiting[:size]
        return -1

    def _ubx_size(self) -> int:
        """Bytes of the UBX message at the front; 0 while it is unfinished; -1 after a false start was skipped."""
        waiting = self._waiting
        if len(waiting) >= 2 and waiting[1] != UBX_HDR[1]:
            return self._skip(1)
        if len(waiting) < 6:
            return 0
        payload = int.from_bytes(waiting[4:6], "little")
        if payload > MAX_UBX_PAYLOAD:
            return self._skip(2)
        size = payload + 8
        if len(waiting) < size:
            if not _holds_frame(bytes(waiting[2:])):
                return 0
            self.ubx_failures += 1
            return self._skip(2)
        if not isvalid_checksum(bytes(waiting[:size])):
            self.ubx_failures += 1
            return self._skip(2)
        return size

    def _sentence_size(self) -> int:
        """As `_ubx_size`, of a sentence with its line end."""
        waiting = self._waiting
        body = _BODY.match(waiting)
        end = body.end() if body else 1
        after = bytes(waiting[end : end + 2])
        if end <= MAX_SENTENCE:
            if after in {b"", b"\r"}:
                return 0
            if after == b"\r\n" or after[:1] == b"\n":
                return end + (2 if after == b"\r\n" else 1)
        self.cut_sentences += 1
        return self._skip(end)


def _holds_frame(data: bytes) -> bool:
    """Whether a whole frame whose checksum fits lies within: what seems to go round it has a damaged length."""
    for found in _SENTENCE.finditer(data):
        if functools.reduce(operator.xor, found[1]) == int(found[2], 16):
            return True
    for found in _UBX.finditer(data):
        size = int.from_bytes(found[1], "little") + 8
        frame = data[found.start() : found.start() + size]
        if len(frame) == size and isvalid_checksum(frame):
            return True
    return False
