"""The newest picture again and again, as `multipart/x-mixed-replace`: for what shows no more than an MJPEG stream."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from aiohttp import web

from paani import keys
from paani.bus import Picture
from paani_services.dashboard.connections import hold_little_unsent
from paani_services.dashboard.hub import Hub
from paani_services.dashboard.responses import error_response

MAX_STREAMS = 4
SEND_TIMEOUT_S = 15.0
BOUNDARY = "picture"
MEDIA_TYPE = f"multipart/x-mixed-replace; boundary={BOUNDARY}"


class PictureStreams:
    """Streams to a bounded number of clients. A slow one is sent fewer pictures, the newest each time."""

    def __init__(self, hub: Hub, headers: dict[str, str]) -> None:
        """headers: of every answer."""
        self._hub, self._headers, self._count = hub, headers, 0

    async def serve(self, request: web.Request, may_watch: Callable[[], bool]) -> web.StreamResponse:
        """Until the client goes away, takes nothing for `SEND_TIMEOUT_S`, or may not watch any more."""
        if self._count >= MAX_STREAMS:
            return error_response(503, f"{MAX_STREAMS} streams are open, which is all there are", request.path)
        self._count += 1
        response = web.StreamResponse(headers={**self._headers, "Content-Type": MEDIA_TYPE})
        try:
            with self._hub.changes(keys.PICTURE.name) as changed:
                await response.prepare(request)
                hold_little_unsent(request)
                while may_watch():
                    await changed.wait()
                    changed.clear()
                    picture, _ = self._hub.newest(keys.PICTURE.name) or (None, 0)
                    if isinstance(picture, Picture):
                        async with asyncio.timeout(SEND_TIMEOUT_S):
                            await response.write(encode_part(picture))
        except (ConnectionError, TimeoutError):
            if request.transport is not None:
                request.transport.abort()
        finally:
            self._count -= 1
        return response


def encode_part(picture: Picture) -> bytes:
    """One part of the stream, with the picture's stamp and number among its headers."""
    header = picture.header
    head = (
        f"--{BOUNDARY}\r\nContent-Type: {header.media_type}\r\nContent-Length: {len(picture.data)}\r\n"
        f"X-Frame-Id: {header.frame_epoch}.{header.frame_seq}\r\nX-Source-Us: {header.source_us}\r\n\r\n"
    )
    return b"".join((head.encode(), picture.data, b"\r\n"))
