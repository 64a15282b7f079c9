"""A link between page and boat that takes its time: bytes of both directions are passed on later, in their order."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator

CHUNK_BYTES = 65_536


@contextlib.asynccontextmanager
async def slow_link(host: str, port: int, delay_s: float) -> AsyncIterator[int]:
    """A port of this machine that leads there; whatever is sent either way arrives `delay_s` later."""
    relays = set[asyncio.Task[None]]()

    async def accept(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        far_reader, far_writer = await asyncio.open_connection(host, port)
        for source, target in ((reader, far_writer), (far_reader, writer)):
            task = asyncio.create_task(_relay(source, target, delay_s))
            relays.add(task)
            task.add_done_callback(relays.discard)

    server = await asyncio.start_server(accept, "127.0.0.1", 0)
    try:
        yield int(server.sockets[0].getsockname()[1])
    finally:
        server.close()
        for task in tuple(relays):
            task.cancel()


async def _relay(source: asyncio.StreamReader, target: asyncio.StreamWriter, delay_s: float) -> None:
    loop = asyncio.get_running_loop()

    def pass_on(data: bytes) -> None:
        if not target.is_closing():
            target.write(data)

    with contextlib.suppress(ConnectionError):
        while data := await source.read(CHUNK_BYTES):
            loop.call_later(delay_s, pass_on, data)
    loop.call_later(delay_s, target.close)
