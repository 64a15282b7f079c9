"""Faults of the link between board and host: a relay between their routers that cuts, stalls or slows."""

from __future__ import annotations

import asyncio
import contextlib

from paani_tools.bench.faults.fault import Drive, Expected, Fault
from paani_tools.bench.faults.running import Loop

LASTS_S = 2.0
CHUNK = 16384
SLOW_BYTES_S = 20_000.0


class Relay:
    """Carries bytes from the port that the host's router connects to, to the board's."""

    def __init__(self, port: int, target: int) -> None:
        self._port, self._target = port, target
        self._server: asyncio.Server | None = None
        self._writers = set[asyncio.StreamWriter]()
        self._tasks = set[asyncio.Task[None]]()
        self._open = asyncio.Event()
        self._open.set()
        self.bytes_s = 0.0  # 0: as fast as it goes

    async def start(self) -> None:
        """Take connections."""
        self._server = await asyncio.start_server(self._serve, "127.0.0.1", self._port)

    async def cut(self) -> None:
        """End every connection, and take none."""
        if self._server is not None:
            self._server.close()
        for writer in list(self._writers):
            writer.transport.abort()

    def stall(self) -> None:
        """Connections stay, and nothing passes."""
        self._open.clear()

    def flow(self) -> None:
        """Everything passes again."""
        self._open.set()
        self.bytes_s = 0.0

    async def stop(self) -> None:
        """End."""
        await self.cut()
        for task in list(self._tasks):
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        self._tasks.add(task)
        with contextlib.suppress(OSError, asyncio.CancelledError):
            far_reader, far_writer = await asyncio.open_connection("127.0.0.1", self._target)
            self._writers |= {writer, far_writer}
            directions = [self._carry(reader, far_writer), self._carry(far_reader, writer)]
            await asyncio.wait([asyncio.create_task(way) for way in directions], return_when=asyncio.FIRST_COMPLETED)
            for end in (writer, far_writer):
                end.transport.abort()
            self._writers -= {writer, far_writer}
        self._tasks.discard(task)

    async def _carry(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with contextlib.suppress(OSError):
            while data := await reader.read(CHUNK):
                await self._open.wait()
                if self.bytes_s:
                    await asyncio.sleep(len(data) / self.bytes_s)
                writer.write(data)
                await writer.drain()


def link_faults(relay: Relay) -> list[Fault]:
    """By this relay, which must be between the routers."""

    async def cut(loop: Loop) -> None:
        loop.mark()
        await relay.cut()

    async def stall(loop: Loop) -> None:
        loop.mark()
        relay.stall()

    async def slow(loop: Loop) -> None:
        loop.mark()
        relay.bytes_s = SLOW_BYTES_S

    async def mend(loop: Loop) -> None:
        await relay.start()

    async def flow(loop: Loop) -> None:
        relay.flow()

    common = {"lasts_s": LASTS_S, "drive": Drive.LINK}
    return [
        Fault(name="link cut", expected=Expected.STOPS, begin=cut, end=mend, **common),  # type: ignore[arg-type]
        Fault(name="link stalled", expected=Expected.STOPS, begin=stall, end=flow, **common),  # type: ignore[arg-type]
        Fault(name="link at 20 kB/s", expected=Expected.GOES_ON, begin=slow, end=flow, **common),  # type: ignore[arg-type]
    ]
