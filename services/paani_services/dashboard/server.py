"""The web server: the page, its socket, STOP and arm."""

from __future__ import annotations

import asyncio
import hmac
from collections.abc import Awaitable, Callable

import msgspec
from aiohttp import WSCloseCode, WSMsgType, web

from paani import keys
from paani import messages as m
from paani.bus import Picture
from paani.clock import Clock
from paani.config import DashboardConfig
from paani.errors import UserError
from paani_services.dashboard.console import Console
from paani_services.dashboard.hub import Client, Event, Hub
from paani_services.dashboard.pages import SECURITY_HEADERS, Page
from paani_services.dashboard.requests import (
    ArmRequest,
    BadRequestError,
    NoQuery,
    SnapshotQuery,
    is_our_host,
    is_same_origin,
    read_body,
    read_query,
)
from paani_services.dashboard.tuning import ProposalRequest, ProposeRequest, Tuner

MAX_CLIENTS = 16
MAX_BODY_BYTES = 4096
SEND_TIMEOUT_S = 15.0
HEARTBEAT_S = 5.0
TOKEN_HEADER = "X-Paani-Token"
MAX_REPORT_AGE_S = 3.0
STOP_PATH = "/api/stop"

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


class Server:
    """HTTP in front of the hub and the console."""

    def __init__(
        self,
        hub: Hub,
        console: Console,
        tuner: Tuner,
        clock: Clock,
        config: DashboardConfig,
        pages: dict[str, Page],
        token: str,
    ) -> None:
        self._hub, self._console, self._tuner = hub, console, tuner
        self._clock, self._config, self._pages, self._token = clock, config, pages, token

    def app(self) -> web.Application:
        app = web.Application(middlewares=[self._guard], client_max_size=MAX_BODY_BYTES)
        app.add_routes(
            [
                web.get("/", self._page),
                web.get("/static/{name}", self._page),
                web.get("/ws", self._socket),
                web.get("/snapshot.jpg", self._snapshot),
                web.get("/healthz", self._healthz),
                web.get("/api/topics", self._topics),
                web.post(STOP_PATH, self._stop),
                web.post("/api/arm", self._arm),
                web.get("/api/tune", self._tuning),
                web.post("/api/tune/propose", self._propose),
                web.post("/api/tune/promote", self._promote),
                web.post("/api/tune/rollback", self._rollback),
            ]
        )
        return app

    @web.middleware
    async def _guard(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        """Refuse strangers, answer errors in JSON, send the security headers with everything."""
        try:
            if request.path != STOP_PATH and not is_our_host(request.host, self._config.host):
                response: web.StreamResponse = refusal(403, "Host: not a name of this server", "Host")
            else:
                response = await handler(request)
        except BadRequestError as error:
            response = refusal(400, str(error), error.field)
        except web.HTTPException as error:
            response = refusal(error.status, error.reason, request.path)
        if not response.prepared:
            response.headers.update(SECURITY_HEADERS)
        return response

    async def _page(self, request: web.Request) -> web.Response:
        page = self._pages.get(request.match_info.get("name", "index.html"))
        if page is None:
            raise web.HTTPNotFound
        return web.Response(body=page.body, content_type=page.media_type, charset="utf-8")

    async def _stop(self, request: web.Request) -> web.Response:
        """Whoever asks, whatever they send: the boat stops."""
        kept = await self._console.stop()
        self._hub.tell(
            Event(self._clock.now_us(), "stop", "STOP asked" + ("" if kept else "; the disk did not keep it"))
        )
        return answer({"stopped": True, "kept": kept})

    async def _arm(self, request: web.Request) -> web.Response:
        if (stranger := self._stranger(request, "arm")) is not None:
            return stranger
        read_body(await request.read(), ArmRequest)
        if self._tuner.is_asking:
            return refusal(409, "not armed: a tuning request waits for the advisor", "armed")
        if not await self._console.arm():
            return refusal(409, "not armed: a STOP came meanwhile, or the latch could not be released on disk", "armed")
        self._hub.tell(Event(self._clock.now_us(), "warn", "armed"))
        return answer({"armed": True})

    def _stranger(self, request: web.Request, deed: str) -> web.Response | None:
        """The refusal for a request that is not of this server's own page, with its token."""
        if not is_same_origin(request.headers.get("Origin"), request.host):
            return refusal(403, f"Origin: only this server's own page may {deed}", "Origin")
        if not hmac.compare_digest(request.headers.get(TOKEN_HEADER, "").encode(), self._token.encode()):
            return refusal(403, f"{TOKEN_HEADER}: not the token of this page; load it again", TOKEN_HEADER)
        return None

    async def _propose(self, request: web.Request) -> web.Response:
        if (stranger := self._stranger(request, "tune")) is not None:
            return stranger
        return tuning_answer(await self._tuner.propose(read_body(await request.read(), ProposeRequest).changes))

    async def _promote(self, request: web.Request) -> web.Response:
        return await self._name(request, m.TuningAct.PROMOTE)

    async def _rollback(self, request: web.Request) -> web.Response:
        return await self._name(request, m.TuningAct.ROLLBACK)

    async def _name(self, request: web.Request, act: m.TuningAct) -> web.Response:
        if (stranger := self._stranger(request, "tune")) is not None:
            return stranger
        return tuning_answer(await self._tuner.name(act, read_body(await request.read(), ProposalRequest).proposal))

    async def _tuning(self, request: web.Request) -> web.Response:
        read_query(dict(request.query), NoQuery)
        shadow, received_us = self._hub.newest(keys.SHADOW.name) or (None, 0)
        if shadow is None or (self._clock.now_us() - received_us) * 1e-6 > MAX_REPORT_AGE_S:
            return refusal(503, "the advisor does not report", keys.SHADOW.name)
        return answer(shadow)

    async def _snapshot(self, request: web.Request) -> web.Response:
        wanted = read_query(dict(request.query), SnapshotQuery)
        value, received_us = self._hub.newest(keys.PICTURE.name) or (None, 0)
        age_s = (self._clock.now_us() - received_us) * 1e-6
        if not isinstance(value, Picture) or age_s > wanted.max_age_s:
            return refusal(503, f"{keys.PICTURE.name}: no picture younger than {wanted.max_age_s:g} s", "max_age_s")
        headers = {"X-Age-S": f"{age_s:.3f}", "X-Frame-Id": f"{value.header.frame_epoch}.{value.header.frame_seq}"}
        return web.Response(body=value.data, content_type=value.header.media_type, headers=headers)

    async def _healthz(self, request: web.Request) -> web.Response:
        read_query(dict(request.query), NoQuery)
        state = self._console.state
        return answer({"ok": True, "clients": len(self._hub.clients), "armed": state.armed, "stopped": state.stopped})

    async def _topics(self, request: web.Request) -> web.Response:
        read_query(dict(request.query), NoQuery)
        return answer([topic_row(topic) for topic in keys.TOPICS])

    async def _socket(self, request: web.Request) -> web.StreamResponse:
        if not is_same_origin(request.headers.get("Origin"), request.host):
            return refusal(403, "Origin: only this server's own page may watch", "Origin")
        if len(self._hub.clients) >= MAX_CLIENTS:
            return refusal(503, f"{MAX_CLIENTS} pages watch already", "clients")
        socket = web.WebSocketResponse(heartbeat=HEARTBEAT_S, compress=False, max_msg_size=1024)
        socket.headers.update(SECURITY_HEADERS)
        await socket.prepare(request)
        client = self._hub.join(self._clock.now_us())
        sender = asyncio.create_task(send_all(socket, client))
        try:
            async for message in socket:
                if message.type in {WSMsgType.TEXT, WSMsgType.BINARY}:
                    await socket.close(code=WSCloseCode.POLICY_VIOLATION, message=b"this socket only speaks")
        finally:
            self._hub.leave(client)
            sender.cancel()
        return socket


async def send_all(socket: web.WebSocketResponse, client: Client) -> None:
    """Send what waits, newest wins; a client that takes nothing for `SEND_TIMEOUT_S` is let go."""
    try:
        while True:
            await client.bell.wait()
            client.bell.clear()
            while (frame := client.slots.pop()) is not None:
                async with asyncio.timeout(SEND_TIMEOUT_S):
                    await socket.send_bytes(frame)
    except (ConnectionError, TimeoutError):
        await socket.close(code=WSCloseCode.TRY_AGAIN_LATER)


async def start_server(app: web.Application, config: DashboardConfig) -> web.AppRunner:
    """Listen on the configured host alone. Raises UserError naming `dashboard.port` or `dashboard.host`."""
    runner = web.AppRunner(app, access_log=None, shutdown_timeout=1.0)
    await runner.setup()
    try:
        await web.TCPSite(runner, config.host, config.port).start()
    except OSError as error:
        await runner.cleanup()
        field = "dashboard.host" if isinstance(error.errno, int) and error.errno < 0 else "dashboard.port"
        raise UserError(f"{field} {config.host}:{config.port}: {error.strerror}") from error
    return runner


def topic_row(topic: keys.Topic[m.Message]) -> dict[str, object]:
    """A row of the table of keys, for the page."""
    return {
        "name": topic.name,
        "type": topic.type.__name__,
        "producer": topic.producer,
        "rate_hz": topic.rate_hz,
        "fresh_s": topic.fresh_s,
        "stance": topic.stance.value,
        "summary": topic.summary,
    }


def tuning_answer(shadow: m.Shadow | None) -> web.Response:
    """The advisor's report as it answered; 409 where it refused, 503 where it was not heard."""
    if shadow is None:
        return refusal(503, "the advisor did not answer", keys.SHADOW.name)
    return answer(shadow, 200 if shadow.refusal is m.TuningRefusal.NONE else 409)


def answer(value: object, status: int = 200) -> web.Response:
    return web.Response(status=status, body=msgspec.json.encode(value), content_type="application/json")


def refusal(status: int, text: str, field: str) -> web.Response:
    return answer({"error": text, "field": field}, status)
