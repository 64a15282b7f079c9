"""Requests of a player by RTSP 1.0 (RFC 2326) and their answers. Pure.

Pictures travel in the player's own TCP connection: to UDP it is told to try that (461), as players do by themselves.
"""

from __future__ import annotations

import re
from typing import NamedTuple

from paani_services.mavlink.rtp_jpeg import PAYLOAD_TYPE

PATH = "/camera"
MAX_REQUEST_BYTES = 8192
METHODS = "OPTIONS, DESCRIBE, SETUP, PLAY, PAUSE, GET_PARAMETER, TEARDOWN"
BAD_REQUEST, NOT_FOUND, NOT_ALLOWED = "400 Bad Request", "404 Not Found", "405 Method Not Allowed"
NO_SESSION, TRY_TCP = "454 Session Not Found", "461 Unsupported Transport"
INTERLEAVED = ord("$")
INTERLEAVED_HEAD_BYTES = 4
_TCP = re.compile(r"RTP/AVP/TCP;(?:[^,]*;)?interleaved=(\d{1,3})-(\d{1,3})(?:[;,]|$)")


class Request(NamedTuple):
    """headers: by their names in small letters."""

    method: str
    path: str
    headers: dict[str, str]


class Answer(NamedTuple):
    """`data` goes to the player. is_playing: whether pictures follow; None: as before. is_last: the player leaves."""

    data: bytes
    is_playing: bool | None = None
    is_last: bool = False


def split_request(buffer: bytes) -> tuple[Request | None, int]:
    """The request at the start of a buffer and how many bytes it takes; None: not whole yet, 0, or no request, passed.

    Reports of the receiver, which come between requests, are passed over. Raises ValueError for what is no RTSP.
    """
    if buffer[:1] == bytes([INTERLEAVED]):
        end = INTERLEAVED_HEAD_BYTES + int.from_bytes(buffer[2:4], "big")
        return None, end if len(buffer) >= max(end, INTERLEAVED_HEAD_BYTES) else 0
    head, blank, _ = buffer.partition(b"\r\n\r\n")
    if not blank:
        if len(buffer) > MAX_REQUEST_BYTES:
            raise ValueError("too long")
        return None, 0
    first, *lines = head.decode("latin-1").split("\r\n")
    match = re.fullmatch(r"([A-Z_]+) (?:rtsp://[^/ ]*)?(/[^ ]*|\*|) RTSP/1\.0", first)
    if match is None:
        raise ValueError("no RTSP")
    headers = {name.strip().lower(): value.strip() for name, _, value in (line.partition(":") for line in lines)}
    length = headers.get("content-length", "0")
    if not re.fullmatch(r"\d{1,4}", length):
        raise ValueError("too long")
    end = len(head) + len(blank) + int(length)
    return (Request(match[1], match[2], headers), end) if len(buffer) >= end else (None, 0)


class Session:
    """One player. name: of its session, which it repeats. host: this end's address, for the description."""

    def __init__(self, name: str, host: str, title: str) -> None:
        self._name, self._host, self._title = name, host, title
        self.channel: int | None = None  # of the connection, for pictures

    def answer(self, request: Request) -> Answer:
        """The answer to one request, and what follows from it."""
        if request.method == "OPTIONS":
            return self._ok(request, f"Public: {METHODS}")
        if request.method not in METHODS.split(", "):
            return self._refuse(request, NOT_ALLOWED)
        if request.method == "GET_PARAMETER":
            return self._ok(request)
        if request.path.rstrip("/").removesuffix("/track") != PATH:
            return self._refuse(request, NOT_FOUND)
        if request.method == "DESCRIBE":
            return self._describe(request)
        if request.method == "SETUP":
            return self._setup(request)
        if self.channel is None or request.headers.get("session", "").split(";")[0] != self._name:
            return self._refuse(request, NO_SESSION)
        answer = self._ok(request)
        return answer._replace(is_playing=request.method == "PLAY", is_last=request.method == "TEARDOWN")

    def _describe(self, request: Request) -> Answer:
        family = "IP6" if ":" in self._host else "IP4"
        lines = (
            "v=0", f"o=- 1 1 IN {family} {self._host}", f"s={self._title}", f"c=IN {family} {self._host}", "t=0 0",
            "a=control:*", "a=range:npt=now-", f"m=video 0 RTP/AVP {PAYLOAD_TYPE}", "a=control:track", "",
        )  # fmt: skip
        body = "\r\n".join(lines)
        return self._ok(request, "Content-Type: application/sdp", f"Content-Length: {len(body)}", body=body)

    def _setup(self, request: Request) -> Answer:
        match = _TCP.search(request.headers.get("transport", ""))
        if match is None or int(match[1]) > 255:
            return self._refuse(request, TRY_TCP)
        self.channel = int(match[1])
        return self._ok(request, f"Transport: RTP/AVP/TCP;unicast;interleaved={match[1]}-{match[2]}")

    def _ok(self, request: Request, *headers: str, body: str = "") -> Answer:
        named = () if self.channel is None else (f"Session: {self._name};timeout=60",)
        return Answer(_text("200 OK", request, *named, *headers, body=body))

    def _refuse(self, request: Request, status: str) -> Answer:
        return Answer(_text(status, request))


def interleaved(channel: int, packet: bytes) -> bytes:
    """A packet within the connection."""
    return bytes([INTERLEAVED, channel]) + len(packet).to_bytes(2, "big") + packet


def refusal() -> bytes:
    """To whoever speaks no RTSP."""
    return f"RTSP/1.0 {BAD_REQUEST}\r\n\r\n".encode()


def _text(status: str, request: Request, *headers: str, body: str = "") -> bytes:
    number = request.headers.get("cseq", "")
    numbered = (f"CSeq: {number}",) if re.fullmatch(r"\d{1,10}", number) else ()
    return "\r\n".join((f"RTSP/1.0 {status}", *numbered, *headers, "", body)).encode("latin-1", "replace")
