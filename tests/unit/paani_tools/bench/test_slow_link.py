"""The link that takes its time: both directions, in their order, and an end that comes as late."""

from __future__ import annotations

import asyncio

import pytest

from paani_tools.bench.deck.slow_link import slow_link

DELAY_S = 0.1


@pytest.mark.slow
async def test_bytes_arrive_later_and_in_their_order() -> None:
    loop = asyncio.get_running_loop()

    async def echo(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        while data := await reader.read(100):
            writer.write(data)
        writer.close()

    server = await asyncio.start_server(echo, "127.0.0.1", 0)
    async with server, slow_link("127.0.0.1", server.sockets[0].getsockname()[1], DELAY_S) as port:
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        begun = loop.time()
        for part in (b"one ", b"two ", b"three"):
            writer.write(part)
            await asyncio.sleep(0.01)
        async with asyncio.timeout(10.0):
            assert await reader.readexactly(13) == b"one two three"
            assert loop.time() - begun >= 2 * DELAY_S
            writer.write_eof()
            assert await reader.read() == b""
        writer.close()
