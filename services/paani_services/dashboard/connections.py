"""Bounds the connections of the web server, so that a STOP always finds one free, and what waits in each.

An idle connection costs a descriptor, and a process that has none left accepts nobody. Beyond the bound, whoever comes
takes the place of the connection that has been idle longest: one without a request, or in the middle of a slow one's
headers.
"""

from __future__ import annotations

import socket
from collections.abc import Container

from aiohttp import web
from aiohttp.web_protocol import RequestHandler

MAX_CONNECTIONS = 128  # pages keep six each at most; far below the 1,024 descriptors that a process usually has
UNSENT_BYTES = 16_384  # of a connection, beside the frame that is being sent


def hold_little_unsent(request: web.Request) -> None:
    """Have what a slow client has not taken wait where the newest wins, and not in the kernel, which keeps megabytes.

    For whatever goes on and on: a client that is far behind would be told of a boat of long ago.
    """
    if (transport := request.transport) is not None:
        transport.set_write_buffer_limits(high=UNSENT_BYTES)
        connection = transport.get_extra_info("socket")
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NOTSENT_LOWAT, UNSENT_BYTES)


class BoundedConnections:
    """Makes the protocol of each new connection: for `loop.create_server`."""

    def __init__(self, server: web.Server, busy: Container[object]) -> None:
        """busy: protocols of the connections whose request is being answered; these keep their places."""
        self._server, self._busy = server, busy

    def __call__(self) -> RequestHandler:
        """The protocol of a connection that has just been accepted."""
        transports = [(each, each.transport) for each in self._server.connections]
        open_ones = [(each, found) for each, found in transports if found is not None and not found.is_closing()]
        idle = [transport for each, transport in open_ones if each not in self._busy]
        for transport in idle[: max(0, len(open_ones) + 1 - MAX_CONNECTIONS)]:
            transport.abort()
        return self._server()
