"""Requests of the page for recordings: list, download, protect, delete, and what is needed to play one."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import msgspec
from aiohttp import web

from paani.errors import one_line
from paani_services.dashboard.answers import DoneAnswer
from paani_services.dashboard.past import frames_response, read_window
from paani_services.dashboard.recordings import RecordingFolder, RecordingRefusedError
from paani_services.dashboard.requests import NoQuery, decode_body, decode_query
from paani_services.dashboard.responses import error_response, json_response

READER = "paani_services.dashboard.recording_reader"
READ_TIMEOUT_S = 60.0
NICE = 5  # of whoever reads beside a boat, as of drawing; at 10 a busy machine had people wait for 20 s and more
MAX_WAITING = 4  # requests to read that wait for the one being served

Refuse = Callable[[web.Request, str], web.Response | None]
FileName = Annotated[str, msgspec.Meta(min_length=1, max_length=80)]


class RecordingRequest(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The recording that is meant."""

    name: FileName


class ProtectRequest(RecordingRequest, frozen=True, forbid_unknown_fields=True):
    """Whether it is to be kept whatever the budget."""

    protected: bool


class RecordingRoutes:
    """folder: of the recorder. replayed: what the page plays instead of the present; empty: nothing.

    refuse: the error response to an act that is not from the operator's own page, else None.
    """

    def __init__(self, folder: str, replayed: str, refuse: Refuse) -> None:
        self._folder, self._replayed, self._refuse = RecordingFolder(folder), replayed, refuse
        self._reading, self._waiting = asyncio.Lock(), 0

    def routes(self) -> list[web.RouteDef]:
        return [
            web.get("/api/recordings", self._list),
            web.get("/api/recordings/{name}/file", self._file),
            web.get("/api/recordings/{name}/series", self._series),
            web.get("/api/recordings/{name}/frames", self._frames),
            web.get("/api/replayed/series", self._series),
            web.get("/api/replayed/frames", self._frames),
            web.post("/api/recordings/protect", self._protect),
            web.post("/api/recordings/delete", self._delete),
        ]

    async def _list(self, request: web.Request) -> web.Response:
        decode_query(dict(request.query), NoQuery)
        return json_response(await asyncio.to_thread(self._folder.list))

    async def _file(self, request: web.Request) -> web.StreamResponse:
        decode_query(dict(request.query), NoQuery)
        try:
            path = await asyncio.to_thread(self._folder.find, request.match_info["name"])
        except RecordingRefusedError as error:
            return error_response(error.status, str(error), "name")
        headers = {
            "Content-Disposition": f'attachment; filename="{path.name}"',
            "Content-Type": "application/octet-stream",
        }
        return web.FileResponse(path, headers=headers)

    async def _series(self, request: web.Request) -> web.Response:
        decode_query(dict(request.query), NoQuery)
        found = await self._read(request, "series")
        return found if isinstance(found, web.Response) else web.Response(body=found, content_type="application/json")

    async def _frames(self, request: web.Request) -> web.Response:
        found = await self._read(request, "frames", *map(str, read_window(request)))
        return found if isinstance(found, web.Response) else frames_response(found)

    async def _protect(self, request: web.Request) -> web.Response:
        if (refused := self._refuse(request, "protect recordings")) is not None:
            return refused
        wanted = decode_body(await request.read(), ProtectRequest)
        try:
            await asyncio.to_thread(self._folder.protect, wanted.name, protected=wanted.protected)
        except RecordingRefusedError as error:
            return error_response(error.status, str(error), "name")
        return json_response(DoneAnswer(True))

    async def _delete(self, request: web.Request) -> web.Response:
        if (refused := self._refuse(request, "delete recordings")) is not None:
            return refused
        name = decode_body(await request.read(), RecordingRequest).name
        try:
            await asyncio.to_thread(self._folder.delete, name)
        except RecordingRefusedError as error:
            return error_response(error.status, str(error), "name")
        return json_response(DoneAnswer(True))

    def _find(self, name: str | None) -> Path:
        """A recording of the folder; None: the one that is replayed. Raises RecordingRefusedError."""
        if name is not None:
            return self._folder.find(name)
        if not self._replayed:
            raise RecordingRefusedError(404, "dashboard.replayed: not set, so no recording is replayed")
        return Path(self._replayed)

    async def _read(self, request: web.Request, *words: str) -> bytes | web.Response:
        """What the reader writes of a recording, or the error response; one reader at a time."""
        name = request.match_info.get("name")
        try:
            path = await asyncio.to_thread(self._find, name)
        except RecordingRefusedError as error:
            return error_response(error.status, str(error), "name")
        if self._waiting >= MAX_WAITING:
            return error_response(503, "name: other recordings are being read, try again", "name")
        self._waiting += 1
        try:
            async with self._reading:
                nice = NICE if name is not None else 0  # a page that only replays has no boat beside it
                return await _run_reader(nice, words[0], path, *words[1:])
        finally:
            self._waiting -= 1


async def _run_reader(nice: int, what: str, path: Path, *words: str) -> bytes | web.Response:
    reader = await asyncio.create_subprocess_exec(
        sys.executable, "-m", READER, str(nice), what, str(path), *words,
        stdin=asyncio.subprocess.DEVNULL, stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.PIPE,
    )  # fmt: skip
    try:
        async with asyncio.timeout(READ_TIMEOUT_S):
            body, errors = await reader.communicate()
    except TimeoutError:
        return error_response(503, f"name: reading took longer than {READ_TIMEOUT_S:.0f} s", "name")
    finally:
        if reader.returncode is None:
            reader.kill()
    if reader.returncode == 0:
        return body
    lines = errors.decode(errors="replace").strip().splitlines() or ["the reader ended"]
    return error_response(409, one_line(lines[-1]), "name")
