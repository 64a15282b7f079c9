"""Accepts the connections of the page's server, encrypted where other machines reach it."""

from __future__ import annotations

import asyncio
import contextlib
import socket
import ssl
from collections.abc import AsyncIterator, Awaitable, Callable

from paani.errors import UserError

HANDSHAKE_S = 5.0
MAX_HANDSHAKES = 64  # at once; whoever has been at it longest gives way, so that a STOP always finds a place
BACKLOG = 128

Protocols = Callable[[], asyncio.Protocol]
Close = Callable[[], Awaitable[None]]


@contextlib.asynccontextmanager
async def listening(protocols: Protocols, host: str, port: int, tls: ssl.SSLContext | None) -> AsyncIterator[None]:
    """Listen while the context lasts. Raises UserError naming `dashboard.port` or `dashboard.host`."""
    try:
        close = await (_listen(protocols, host, port) if tls is None else _listen_by_tls(protocols, host, port, tls))
    except OSError as error:
        field = "dashboard.host" if isinstance(error.errno, int) and error.errno < 0 else "dashboard.port"
        raise UserError(f"{field} {host}:{port}: {error.strerror}") from error
    try:
        yield
    finally:
        await close()


async def _listen(protocols: Protocols, host: str, port: int) -> Close:
    server = await asyncio.get_running_loop().create_server(protocols, host, port)

    async def close() -> None:
        server.close()

    return close


async def _listen_by_tls(protocols: Protocols, host: str, port: int, tls: ssl.SSLContext) -> Close:
    found = await asyncio.get_running_loop().getaddrinfo(host, port, type=socket.SOCK_STREAM)
    listener = socket.create_server(found[0][4][:2], family=found[0][0], backlog=BACKLOG)
    listener.setblocking(False)
    accepting = asyncio.create_task(_accept_forever(listener, protocols, tls))

    async def close() -> None:
        accepting.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await accepting
        listener.close()

    return close


async def _accept_forever(listener: socket.socket, protocols: Protocols, tls: ssl.SSLContext) -> None:
    """A task for each handshake, so that nobody waits for another's; the event loop's own server bounds them not."""
    loop = asyncio.get_running_loop()
    handshakes: dict[asyncio.Task[None], None] = {}  # in the order they began
    try:
        while True:
            try:
                connection, _ = await loop.sock_accept(listener)
            except OSError:  # gone before it was accepted, or no descriptor is free
                await asyncio.sleep(0.01)
                continue
            while len(handshakes) >= MAX_HANDSHAKES:
                oldest = next(iter(handshakes))
                del handshakes[oldest]
                oldest.cancel()
            task = loop.create_task(_shake_hands(connection, protocols, tls))
            handshakes[task] = None
            task.add_done_callback(lambda done: handshakes.pop(done, None))
    finally:
        for task in tuple(handshakes):
            task.cancel()


async def _shake_hands(connection: socket.socket, protocols: Protocols, tls: ssl.SSLContext) -> None:
    loop = asyncio.get_running_loop()
    with contextlib.suppress(OSError, TimeoutError):  # ssl.SSLError is an OSError
        await loop.connect_accepted_socket(protocols, connection, ssl=tls, ssl_handshake_timeout=HANDSHAKE_S)
