"""The last lines of a process's log, as `paani up` keeps it on this machine."""

from __future__ import annotations

import asyncio
from pathlib import Path

import msgspec
from aiohttp import web

from paani import keys
from paani.config import BusConfig
from paani.runtime import LOGS, runtime_path
from paani_services.dashboard.requests import NoQuery, decode_query
from paani_services.dashboard.responses import error_response, json_response

MAX_BYTES, MAX_LINES = 16_384, 100
KNOWN = frozenset({*keys.SERVICES, *keys.PORTS, "router"})


class LogLines(msgspec.Struct, frozen=True, kw_only=True):
    """The last lines, oldest first. cut: there are earlier ones in the file."""

    lines: tuple[str, ...]
    cut: bool


class LogRoutes:
    """Answers from the folder of logs."""

    def __init__(self, config: BusConfig) -> None:
        self._folder = runtime_path(config) / LOGS

    def routes(self) -> list[web.RouteDef]:
        return [web.get("/api/logs/{service}", self._log)]

    async def _log(self, request: web.Request) -> web.Response:
        decode_query(dict(request.query), NoQuery)
        service = request.match_info["service"]
        if service not in KNOWN:
            return error_response(404, "service: no process of this name", "service")
        try:
            return json_response(await asyncio.to_thread(read_last_lines, self._folder / f"{service}.log"))
        except FileNotFoundError:
            return error_response(
                404, f"{service} has no log here: it was not started by `paani up` on this machine", "service"
            )
        except OSError as error:
            return error_response(500, f"{service}.log: {error.strerror}", "service")


def read_last_lines(path: Path) -> LogLines:
    """At most MAX_LINES whole lines from the last MAX_BYTES of a file. Raises OSError."""
    with path.open("rb") as file:
        size = file.seek(0, 2)
        file.seek(max(0, size - MAX_BYTES))
        lines = file.read(MAX_BYTES).decode(errors="replace").splitlines()
    whole = lines[1:] if size > MAX_BYTES else lines
    return LogLines(lines=tuple(whole[-MAX_LINES:]), cut=size > MAX_BYTES or len(whole) > MAX_LINES)
