"""The shore's page: a table and a map of all vessels, and STOP for each and for all. None of it needs a key."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Sequence
from pathlib import Path

import msgspec
from aiohttp import web

from paani.errors import UserError
from paani_services.dashboard import pages
from paani_services.dashboard.pages import MEDIA_TYPES, SECURITY_HEADERS
from paani_services.dashboard.requests import is_own_host
from paani_tools.fleet.shore import Vessel, stop_vessels

STATIC = Path(__file__).parent / "static"
ICON = pages.STATIC / "icon.svg"  # the boat's own
HOST = "127.0.0.1"  # this machine alone: whoever reaches the page may watch and stop every vessel
STOP_PATHS = "/api/stop"
MAX_BODY_BYTES = 1024
Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


class FleetPage:
    """Serves the vessels of a shore."""

    def __init__(self, vessels: Sequence[Vessel]) -> None:
        self._vessels = {vessel.name: vessel for vessel in vessels}
        files = (*STATIC.iterdir(), ICON)
        self._files = {path.name: path.read_bytes() for path in files if path.suffix in MEDIA_TYPES}

    def app(self) -> web.Application:
        """The page, its files, the vessels' rows, and STOP."""
        app = web.Application(middlewares=[self._guard], client_max_size=MAX_BODY_BYTES)
        app.add_routes(
            [
                web.get("/", self._file),
                web.get("/static/{name}", self._file),
                web.get("/api/fleet", self._fleet),
                web.post(STOP_PATHS, self._stop_all),
                web.post(f"{STOP_PATHS}/{{name}}", self._stop),
            ]
        )
        return app

    @web.middleware
    async def _guard(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        """Refuse foreign hosts but for STOP, and add the security headers to every response."""
        try:
            if not request.path.startswith(STOP_PATHS) and not is_own_host(request.host, HOST):
                raise web.HTTPForbidden(reason="Host: not a name of this server")
            response = await handler(request)
        except web.HTTPException as error:
            response = _json({"error": error.reason}, error.status)
        response.headers.update(SECURITY_HEADERS)
        return response

    async def _file(self, request: web.Request) -> web.Response:
        name = request.match_info.get("name", "index.html")
        if name not in self._files:
            raise web.HTTPNotFound
        media_type = MEDIA_TYPES[Path(name).suffix]
        return web.Response(body=self._files[name], content_type=media_type, charset="utf-8")

    async def _fleet(self, _: web.Request) -> web.Response:
        return _json([{**msgspec.to_builtins(v.state), "mode": v.state.mode} for v in self._vessels.values()])

    async def _stop(self, request: web.Request) -> web.Response:
        vessel = self._vessels.get(request.match_info["name"])
        if vessel is None:
            raise web.HTTPNotFound(reason="no such vessel")
        return await _stop_and_tell((vessel,))

    async def _stop_all(self, _: web.Request) -> web.Response:
        return await _stop_and_tell(tuple(self._vessels.values()))


async def serve_page(vessels: Sequence[Vessel], port: int, is_up: Callable[[int], None]) -> None:
    """Serve until cancelled. is_up: called once with the port in use. Raises UserError where it is taken."""
    runner = web.AppRunner(await asyncio.to_thread(lambda: FleetPage(vessels).app()), access_log=None)
    await runner.setup()
    try:
        await web.TCPSite(runner, HOST, port).start()
        is_up(int(runner.addresses[0][1]))
        await asyncio.Event().wait()
    except OSError as error:
        raise UserError(f"--port {port}: {error.strerror}") from error
    finally:
        await runner.cleanup()


async def _stop_and_tell(vessels: Sequence[Vessel]) -> web.Response:
    """503 unless every one of them has latched the STOP; which have, by name."""
    states = await stop_vessels(vessels)
    latched = {name: state is not None for name, state in states.items()}
    return _json({"latched": latched}, 200 if all(latched.values()) else 503)


def _json(value: object, status: int = 200) -> web.Response:
    return web.Response(body=msgspec.json.encode(value), status=status, content_type="application/json")
