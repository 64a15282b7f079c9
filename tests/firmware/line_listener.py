"""What the emulated microcontroller says on its line, heard beside the bridge and after it."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator
from pathlib import Path

from paani.messages import Direction, McuState
from paani.microcontroller.payloads import McuStatus
from paani.microcontroller.rpc import MessageScanner, Notification, Response
from tests.at_work import at_work
from tests.mcu_peer import served

STILL = (Direction.STOP, Direction.NO_DATA)


class LineListener:
    """A relay between a bridge and the microcontroller that stays connected to the latter and keeps each status."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.address = ""
        self.statuses: list[McuStatus] = []
        self._reader, self._mcu = reader, writer
        self._clients = set[asyncio.StreamWriter]()

    @property
    def display(self) -> Direction:
        """What the lights showed when it last said so."""
        return self.statuses[-1].display if self.statuses else Direction.NO_DATA

    @property
    def state(self) -> McuState:
        return self.statuses[-1].state if self.statuses else McuState.UNKNOWN

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """One bridge: its bytes go to the microcontroller."""
        self._clients.add(writer)
        try:
            while data := await reader.read(4096):
                self._mcu.write(data)
        except ConnectionError:
            pass
        finally:
            self._clients.discard(writer)

    async def listen(self) -> None:
        scanner = MessageScanner()
        while data := await self._reader.read(4096):
            for client in self._clients:
                client.write(data)
            for message in scanner.feed(data):
                match message:
                    case Response(result=bytes() as payload) | Notification(params=(bytes() as payload,)):
                        if (status := McuStatus.decode(payload)) is not None:
                            self.statuses.append(status)


@contextlib.asynccontextmanager
async def listening_on(line: str) -> AsyncIterator[LineListener]:
    """Listen on a line of the emulator; the bridge uses the listener's address instead."""
    host, _, port = line.removeprefix("socket://").rpartition(":")
    reader, writer = await asyncio.open_connection(host, int(port))
    listener = LineListener(reader, writer)
    try:
        async with at_work(listener.listen()), served(listener.serve) as own_port:
            listener.address = f"socket://127.0.0.1:{own_port}"
            yield listener
    finally:
        writer.close()


async def pipe_to_router(line: str, router: Path) -> None:
    """Be the board's serial connection between the router and the microcontroller; again after the router restarts."""
    host, _, port = line.removeprefix("socket://").rpartition(":")
    mcu_reader, mcu_writer = await asyncio.open_connection(host, int(port))
    try:
        while True:
            with contextlib.suppress(OSError):
                reader, writer = await asyncio.open_unix_connection(router)
                tasks = [
                    asyncio.create_task(_copy(mcu_reader, writer)),
                    asyncio.create_task(_copy(reader, mcu_writer)),
                ]
                try:
                    await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
                finally:
                    for task in tasks:
                        task.cancel()
                    await asyncio.gather(*tasks, return_exceptions=True)
                    writer.close()
            await asyncio.sleep(0.05)
    finally:
        mcu_writer.close()


async def _copy(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    with contextlib.suppress(ConnectionError):
        while data := await reader.read(4096):
            writer.write(data)
