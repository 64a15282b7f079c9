"""Clients of the page's socket beside the page, in a process of their own: what reading costs is not the boat's.

`python -m paani_tools.bench.deck.crowd ORIGIN COUNT` says `READY` once all are connected, and reads until it is ended.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import socket
import sys
from collections.abc import AsyncIterator

import aiohttp

READY = b"ready\n"
READY_S = 20.0
LEAST_PRIORITY = 19  # clients on other machines take no time from the boat's


@contextlib.asynccontextmanager
async def crowd(origin: str, clients: int) -> AsyncIterator[None]:
    """So many clients besides the page; of several, one never reads. Raises TimeoutError where they do not connect."""
    command = (sys.executable, "-m", __name__, origin, str(clients))
    child = await asyncio.create_subprocess_exec(*command, stdout=asyncio.subprocess.PIPE)
    assert child.stdout is not None
    try:
        async with asyncio.timeout(READY_S):
            if await child.stdout.readline() != READY:
                raise TimeoutError(f"the page's server took no {clients} clients more")
        yield
    finally:
        with contextlib.suppress(ProcessLookupError):
            child.kill()
        await child.wait()


@contextlib.asynccontextmanager
async def watching(origin: str) -> AsyncIterator[aiohttp.ClientWebSocketResponse]:
    """One client of the page's socket."""
    async with aiohttp.ClientSession() as client, client.ws_connect(f"{origin}/ws", origin=origin) as found:
        yield found


async def _be_crowd(origin: str, clients: int) -> None:
    async with contextlib.AsyncExitStack() as stack:
        if clients > 1:
            stack.enter_context(await asyncio.to_thread(_deaf_client, origin))
        readers = [await stack.enter_async_context(watching(origin)) for _ in range(max(1, clients - 1))]
        os.write(sys.stdout.fileno(), READY)
        await asyncio.gather(*(_read_forever(each) for each in readers))


async def _read_forever(found: aiohttp.ClientWebSocketResponse) -> None:
    async for _ in found:
        pass


def _deaf_client(origin: str) -> socket.socket:
    """Opens the page's socket and never reads."""
    host, port = origin.partition("//")[2].rsplit(":", 1)
    found = socket.create_connection((host.strip("[]"), int(port)), timeout=5.0)
    found.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    found.sendall(
        f"GET /ws HTTP/1.1\r\nHost: {host}:{port}\r\nOrigin: {origin}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n".encode()
    )
    return found


if __name__ == "__main__":
    os.nice(LEAST_PRIORITY)
    asyncio.run(_be_crowd(sys.argv[1], int(sys.argv[2])))
