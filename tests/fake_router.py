"""A stand-in for the board's arduino-router, after its measured behaviour.

A client registers methods and calls those of others; the routes of a client end with its connection. Notifications are
handed on each by itself, so that two of them may overtake each other; answers return to who asked.
"""

from __future__ import annotations

import asyncio
import contextlib
import random
from pathlib import Path

import msgspec

from paani.microcontroller.rpc import MessageScanner, Notification, Request, Response, encode_request, encode_response

NOT_AVAILABLE, ROUTE_EXISTS = 2, 5
REORDERING_S = 0.004  # 47 of 2000 notifications, sent back to back, came out of order


class FakeRouter:
    """Serves a socket; `stop` ends every connection, as a restart of the service does."""

    def __init__(self, path: Path, rng: random.Random) -> None:
        self._path, self._rng = path, rng
        self._routes: dict[str, asyncio.StreamWriter] = {}
        self._asked: dict[int, tuple[asyncio.StreamWriter, int]] = {}
        self._next_id = 1000
        self._server: asyncio.Server | None = None
        self._tasks = set[asyncio.Task[None]]()

    @property
    def routes(self) -> set[str]:
        return set(self._routes)

    async def start(self) -> None:
        self._server = await asyncio.start_unix_server(self._serve, self._path)

    async def stop(self) -> None:
        if self._server is not None:
            self._server.close()
        for task in list(self._tasks):
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        self._routes.clear()
        self._path.unlink(missing_ok=True)

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        self._tasks.add(task)
        scanner = MessageScanner()
        with contextlib.suppress(ConnectionError, asyncio.CancelledError):
            while data := await reader.read(4096):
                for message in scanner.feed(data):
                    self._route(message, writer)
        self._routes = {name: owner for name, owner in self._routes.items() if owner is not writer}
        self._tasks.discard(task)
        writer.close()

    def _route(self, message: Request | Response | Notification, writer: asyncio.StreamWriter) -> None:
        match message:
            case Request(id=call_id, method="$/reset"):
                self._routes = {name: owner for name, owner in self._routes.items() if owner is not writer}
                writer.write(encode_response(call_id, True))
            case Request(id=call_id, method="$/register", params=(str(name),)):
                if name in self._routes:
                    self._refuse(writer, call_id, ROUTE_EXISTS, f"route already exists: {name}")
                else:
                    self._routes[name] = writer
                    writer.write(encode_response(call_id, True))
            case Request(id=call_id, method=method, params=params) if method in self._routes:
                self._next_id += 1
                self._asked[self._next_id] = (writer, call_id)
                self._routes[method].write(encode_request(self._next_id, method, *params))
            case Request(id=call_id, method=method):
                self._refuse(writer, call_id, NOT_AVAILABLE, f"method {method} not available")
            case Response(id=call_id, result=result):
                asker, asked_id = self._asked.pop(call_id, (None, 0))
                if asker is not None and not asker.is_closing():
                    asker.write(encode_response(asked_id, result))
            case Notification(method=method, params=params) if method in self._routes:
                data = msgspec.msgpack.encode([2, method, list(params)])
                asyncio.get_running_loop().call_later(
                    self._rng.uniform(0.0, REORDERING_S), self._routes[method].write, data
                )

    def _refuse(self, writer: asyncio.StreamWriter, call_id: int, code: int, text: str) -> None:
        writer.write(msgspec.msgpack.encode([1, call_id, [code, text], None]))
