"""Web server of the dashboard: the page, its WebSocket, and the requests to stop, arm, drive and tune."""

from __future__ import annotations

import asyncio
import contextlib
import os
import ssl
from collections.abc import AsyncIterator, Awaitable, Callable

from aiohttp import WSCloseCode, WSMsgType, web

from paani import keys
from paani import messages as m
from paani.clock import Clock
from paani.config import Config, DashboardConfig
from paani.mission_client import MissionClient
from paani.operator_client import OperatorClient
from paani.page_address import LOGIN_PATH
from paani.tuning_refusals import refusal_text
from paani_services.dashboard.answers import ArmedAnswer, HeldAnswer, StopAnswer
from paani_services.dashboard.connections import UNSENT_BYTES, BoundedConnections, hold_little_unsent
from paani_services.dashboard.driving import Driving
from paani_services.dashboard.gatekeeper import Gatekeeper
from paani_services.dashboard.history import History
from paani_services.dashboard.hub import Client, Hub
from paani_services.dashboard.listening import listening
from paani_services.dashboard.machines import Machines
from paani_services.dashboard.missions import Missions
from paani_services.dashboard.operator_events import REFUSALS
from paani_services.dashboard.pages import SECURITY_HEADERS, WORKER, StaticFile
from paani_services.dashboard.past import PastRoutes
from paani_services.dashboard.process_logs import LogRoutes
from paani_services.dashboard.recording_routes import RecordingRoutes
from paani_services.dashboard.requests import (
    BadRequestError,
    NoQuery,
    PressRequest,
    decode_body,
    decode_query,
    is_same_origin,
)
from paani_services.dashboard.responses import error_response, json_response
from paani_services.dashboard.settings_rows import SettingRoutes
from paani_services.dashboard.tiles import TileRoutes, find_tiles
from paani_services.dashboard.tuning import ProposalRequest, ProposeRequest, Tuner

MAX_CLIENTS = 16  # pages at once: one more takes the place of the page that has been connected longest
GIVEN_AWAY = 4001  # close code of a page whose place was taken, from the range for private use (RFC 6455, 7.4.2)
MAX_BODY_BYTES = 4096
LOGGED_OUT = 4002  # close code of a page whose session was ended
SEND_TIMEOUT_S = 15.0
HEARTBEAT_S = 5.0
ANSWER_TIMEOUT_S = 1.0
MAX_REPORT_AGE_S = 3.0
STOP_PATH = "/api/stop"

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


class Server:
    """HTTP routes to the hub, the operator's process and the tuner."""

    def __init__(
        self,
        hub: Hub,
        history: History,
        operator: OperatorClient,
        missions: MissionClient,
        tuner: Tuner,
        clock: Clock,
        config: Config,
        pages: dict[str, StaticFile],
        gatekeeper: Gatekeeper,
    ) -> None:
        self._hub, self._operator, self._tuner = hub, operator, tuner
        self._clock, self._config = clock, config
        self._pages, self._gatekeeper = pages, gatekeeper
        self._missions = Missions(missions, gatekeeper.refuse_act)
        self._machines = Machines(hub, operator, clock, config, gatekeeper)
        self._driving = Driving(operator, gatekeeper.refuse_act)
        self._reading = [
            *PastRoutes(hub, history).routes(),
            *LogRoutes(config.bus).routes(),
            *TileRoutes(config.dashboard.tiles).routes(),
            *SettingRoutes(config, os.environ).routes(),
            *RecordingRoutes(config.recorder.folder, config.dashboard.replayed, gatekeeper.refuse_act).routes(),
        ]
        self._sockets: dict[Client, web.WebSocketResponse] = {}  # in the order they came
        self.busy: set[object] = set()  # protocols of the connections whose request is being answered

    def app(self) -> web.Application:
        app = web.Application(middlewares=[self._guard], client_max_size=MAX_BODY_BYTES)
        app.add_routes(
            [
                web.get("/", self._page),
                web.get("/static/{name}", self._page),
                *([web.get(LOGIN_PATH, self._login)] if self._gatekeeper.asks_login else []),
                web.get("/ws", self._socket),
                *self._machines.routes(),
                web.post(STOP_PATH, self._stop),
                web.post("/api/arm/hold", self._hold),
                web.post("/api/arm/release", self._release),
                *self._driving.routes(),
                *self._missions.routes(),
                *self._gatekeeper.routes(),
                *self._reading,
                web.get("/api/tune", self._tuning),
                web.post("/api/tune/propose", self._propose),
                web.post("/api/tune/promote", self._promote),
                web.post("/api/tune/rollback", self._rollback),
            ]
        )
        return app

    @web.middleware
    async def _guard(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        """Refuse foreign hosts, answer errors in JSON, and add the security headers to every response."""
        self.busy.add(request.protocol)
        try:
            return await self._guarded(request, handler)
        finally:
            self.busy.discard(request.protocol)

    async def _guarded(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        try:
            refused = None if request.path == STOP_PATH else self._gatekeeper.refuse(request)
            response: web.StreamResponse = refused or await handler(request)
        except BadRequestError as error:
            response = error_response(400, str(error), error.field)
        except web.HTTPRedirection as error:
            response = web.Response(status=error.status, headers={"Location": error.headers["Location"]})
        except web.HTTPException as error:
            response = error_response(error.status, error.reason, request.path)
        if not response.prepared:
            response.headers.update(SECURITY_HEADERS)
        return response

    async def _page(self, request: web.Request) -> web.Response:
        return self._file(request.match_info.get("name", "index.html"))

    async def _login(self, request: web.Request) -> web.Response:
        return self._file("login.html")

    def _file(self, name: str) -> web.Response:
        page = self._pages.get(name)
        if page is None:
            raise web.HTTPNotFound
        charset = None if page.media_type.startswith("image/png") else "utf-8"
        headers = {"Service-Worker-Allowed": "/"} if name == WORKER else None
        return web.Response(body=page.body, content_type=page.media_type, charset=charset, headers=headers)

    async def _stop(self, request: web.Request) -> web.Response:
        """Ask for STOP, whoever asks and whatever the request holds."""
        state = await self._operator.stop(ANSWER_TIMEOUT_S)
        if state is None:
            return error_response(503, "the operator's process does not answer: no STOP is latched", "stopped")
        return json_response(StopAnswer(True, state.latch_kept))

    async def _hold(self, request: web.Request) -> web.Response:
        """Pass on that the button of a press is held; how long that has lasted is the operator's process's to say."""
        if (refused := self._refuse_to_arm(request)) is not None:
            return refused
        self._operator.hold(decode_body(await request.read(), PressRequest).press)
        return json_response(HeldAnswer(True))

    async def _release(self, request: web.Request) -> web.Response:
        if (refused := self._refuse_to_arm(request)) is not None:
            return refused
        press = decode_body(await request.read(), PressRequest).press
        refusal = await self._operator.release(press, ANSWER_TIMEOUT_S)
        if refusal is None:
            return error_response(503, "not armed: the operator's process does not answer", "armed")
        if refusal is not m.ArmRefusal.NONE:
            return error_response(409, f"not armed: {REFUSALS[refusal]}", "armed")
        return json_response(ArmedAnswer(True))

    def _refuse_to_arm(self, request: web.Request) -> web.Response | None:
        if (refused := self._gatekeeper.refuse_act(request, "arm")) is not None:
            return refused
        if self._tuner.is_waiting:
            return error_response(409, "not armed: a tuning request waits for the advisor", "armed")
        return None

    async def _propose(self, request: web.Request) -> web.Response:
        if (refused := self._gatekeeper.refuse_act(request, "tune")) is not None:
            return refused
        return tuning_response(await self._tuner.propose(decode_body(await request.read(), ProposeRequest).changes))

    async def _promote(self, request: web.Request) -> web.Response:
        return await self._send_act(request, m.TuningAct.PROMOTE)

    async def _rollback(self, request: web.Request) -> web.Response:
        return await self._send_act(request, m.TuningAct.ROLLBACK)

    async def _send_act(self, request: web.Request, act: m.TuningAct) -> web.Response:
        if (refused := self._gatekeeper.refuse_act(request, "tune")) is not None:
            return refused
        return tuning_response(
            await self._tuner.send_act(act, decode_body(await request.read(), ProposalRequest).proposal)
        )

    async def _tuning(self, request: web.Request) -> web.Response:
        decode_query(dict(request.query), NoQuery)
        shadow, received_us = self._hub.newest(keys.SHADOW.name) or (None, 0)
        if shadow is None or (self._clock.now_us() - received_us) * 1e-6 > MAX_REPORT_AGE_S:
            return error_response(503, "the advisor has sent no report within the last seconds", keys.SHADOW.name)
        return json_response(shadow)

    async def _socket(self, request: web.Request) -> web.StreamResponse:
        if not is_same_origin(request.headers.get("Origin"), request.host):
            return error_response(403, "Origin: only this server's own page may watch", "Origin")
        socket = web.WebSocketResponse(
            heartbeat=HEARTBEAT_S, compress=False, max_msg_size=1024, writer_limit=UNSENT_BYTES
        )
        socket.headers.update(SECURITY_HEADERS)
        await socket.prepare(request)
        hold_little_unsent(request)
        client = self._hub.add_client(self._clock.now_us())
        self._sockets[client] = socket
        closing = [
            asyncio.create_task(each.close(code=GIVEN_AWAY)) for each in list(self._sockets.values())[:-MAX_CLIENTS]
        ]
        sender = asyncio.create_task(send_all(socket, client, lambda: self._gatekeeper.may_watch(request)))
        try:
            async for message in socket:
                if message.type in {WSMsgType.TEXT, WSMsgType.BINARY}:
                    await socket.close(code=WSCloseCode.POLICY_VIOLATION, message=b"this socket accepts no messages")
        finally:
            self._hub.remove_client(client)
            del self._sockets[client]
            for task in (sender, *closing):
                task.cancel()
        return socket


async def send_all(socket: web.WebSocketResponse, client: Client, may_watch: Callable[[], bool]) -> None:
    """Send the queued frames; a client that takes nothing for `SEND_TIMEOUT_S`, or may not watch, is disconnected."""
    try:
        while True:
            await client.frames_ready.wait()
            client.frames_ready.clear()
            while (frame := client.queue.pop()) is not None:
                if not may_watch():
                    await socket.close(code=LOGGED_OUT)
                    return
                async with asyncio.timeout(SEND_TIMEOUT_S):
                    await socket.send_bytes(frame)
    except (ConnectionError, TimeoutError):
        await socket.close(code=WSCloseCode.TRY_AGAIN_LATER)


@contextlib.asynccontextmanager
async def serving(server: Server, config: DashboardConfig, tls: ssl.SSLContext | None) -> AsyncIterator[None]:
    """Listen on the configured host only; tls: None: not encrypted. Raises UserError."""
    await asyncio.to_thread(
        find_tiles, config.tiles
    )  # a mistake in the folder's name is told before anything is served
    runner = web.AppRunner(server.app(), access_log=None, shutdown_timeout=1.0)
    await runner.setup()
    assert runner.server is not None
    try:
        async with listening(BoundedConnections(runner.server, server.busy), config.host, config.port, tls):
            yield
    finally:
        await runner.cleanup()


def tuning_response(shadow: m.Shadow | None) -> web.Response:
    """The advisor's report; status 409 and why where it refused the request, 503 where it did not answer."""
    if shadow is None:
        return error_response(503, "the advisor did not answer", keys.SHADOW.name)
    if shadow.refusal is not m.TuningRefusal.NONE:
        return error_response(409, refusal_text(shadow), shadow.refused_path or keys.SHADOW.name)
    return json_response(shadow)
