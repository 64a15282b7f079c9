"""Who may do what by HTTP: watch, drive and tune, or log in. STOP is for everybody, and passes by this.

On loopback whoever reaches the page may watch, and the operator's key, sent with each request, lets drive. Where other
machines reach the page, nobody sees more than the login without the key: it is given once, for a session whose token
is a cookie that scripts cannot read and that no other site's page can have sent.
"""

from __future__ import annotations

import asyncio
import hmac
import ssl
from typing import Annotated

import msgspec
from aiohttp import web

from paani.certificates import identities_of, page_server_tls
from paani.clock import Clock
from paani.config import Config
from paani.operator_key import ensure_operator_key
from paani.page_address import LOGIN_PATH, is_page_exposed
from paani_services.dashboard.answers import DoneAnswer, SessionAnswer
from paani_services.dashboard.requests import decode_body, is_own_host, is_same_origin
from paani_services.dashboard.responses import error_response, json_response
from paani_services.dashboard.sessions import Sessions

KEY_HEADER = "X-Paani-Key"
OPEN_PATHS = (LOGIN_PATH, "/api/login", "/healthz")  # as are the static files, which hold no secret
STATIC_PREFIX = "/static/"
BODY_TIMEOUT_S = 5.0  # of those who have not said yet who they are


class LoginRequest(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """`key`: the operator's."""

    key: Annotated[str, msgspec.Meta(max_length=256)]


def open_gate(config: Config, clock: Clock) -> tuple[Gatekeeper, ssl.SSLContext | None]:
    """Who judges requests, and what encrypts them; None where nothing has to. Raises UserError. It reads files."""
    key = ensure_operator_key(config.bus)
    if not is_page_exposed(config):
        return Gatekeeper(config, key, clock), None
    tls = page_server_tls(config.bus)
    return Gatekeeper(config, key, clock, identities_of(config.bus).addresses), tls


class Gatekeeper:
    """Judges requests by host, origin, operator's key and session."""

    def __init__(self, config: Config, key: str, clock: Clock, names: tuple[str, ...] = ()) -> None:
        """names: further hosts by which this server is known, as its certificate has them."""
        self.asks_login = is_page_exposed(config)
        self._key, self._clock, self._sessions = key, clock, Sessions()
        self._names = (config.dashboard.host, *names)
        self._cookie = f"__Host-paani-{config.dashboard.port}"  # one host's ports share their cookies

    def routes(self) -> list[web.RouteDef]:
        """Whether a login is asked, and the login where it is."""
        session = web.get("/api/session", self._session)
        if not self.asks_login:
            return [session]
        return [session, web.post("/api/login", self._login), web.post("/api/logout", self._logout)]

    def refuse(self, request: web.Request) -> web.Response | None:
        """The error response to a request by a foreign name, or from nobody who may watch; else None."""
        if not is_own_host(request.host, self._names):
            return error_response(403, "Host: not a name of this server", "Host")
        is_open = request.path in OPEN_PATHS or request.path.startswith(STATIC_PREFIX)
        if is_open or self.may_watch(request):
            return None
        if request.path == "/" and request.method == "GET":
            raise web.HTTPSeeOther(LOGIN_PATH)
        return error_response(401, f"log in first, at {LOGIN_PATH}, or send the operator's key", KEY_HEADER)

    def may_watch(self, request: web.Request) -> bool:
        """Whoever is on loopback, has the key, or has a session, asked anew each time."""
        if not self.asks_login or self._has_key(request):
            return True
        return self._sessions.is_valid(request.cookies.get(self._cookie, ""), self._clock.now_us())

    def refuse_act(self, request: web.Request, action: str) -> web.Response | None:
        """The error response to an act that is not from this server's own page, or without the operator's key."""
        if not is_same_origin(request.headers.get("Origin"), request.host):
            return error_response(403, f"Origin: only this server's own page may {action}", "Origin")
        if self._has_key(request) or (self.asks_login and self.may_watch(request)):
            return None
        return error_response(
            403, f"{KEY_HEADER}: not the operator's key, without which nobody may {action}", KEY_HEADER
        )

    def _has_key(self, request: web.Request) -> bool:
        return self._is_key(request.headers.get(KEY_HEADER, ""))

    def _is_key(self, given: str) -> bool:
        return hmac.compare_digest(given.encode(errors="surrogateescape"), self._key.encode())

    async def _session(self, request: web.Request) -> web.Response:
        return json_response(SessionAnswer(self.asks_login))

    async def _login(self, request: web.Request) -> web.Response:
        if not is_same_origin(request.headers.get("Origin"), request.host):
            return error_response(403, "Origin: only this server's own page may log in", "Origin")
        try:
            async with asyncio.timeout(BODY_TIMEOUT_S):
                body = await request.read()
        except TimeoutError:
            return error_response(408, "the request did not come to its end", "body")
        if not self._is_key(decode_body(body, LoginRequest).key.strip()):
            return error_response(403, "key: not the operator's key", "key")
        response = json_response(DoneAnswer(True))
        token = self._sessions.begin(self._clock.now_us())
        response.set_cookie(self._cookie, token, path="/", secure=True, httponly=True, samesite="Strict")
        return response

    async def _logout(self, request: web.Request) -> web.Response:
        if (refused := self.refuse_act(request, "log out")) is not None:
            return refused
        self._sessions.end(request.cookies.get(self._cookie, ""))
        response = json_response(DoneAnswer(True))
        response.del_cookie(self._cookie, path="/", secure=True, httponly=True, samesite="Strict")
        return response
