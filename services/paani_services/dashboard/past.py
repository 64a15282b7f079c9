"""Requests of the page for the last ten minutes: samples and events, and the frames of a moment."""

from __future__ import annotations

from typing import Annotated

import msgspec
from aiohttp import web

from paani_services.dashboard.history import MAX_WINDOW_US, History, events_since
from paani_services.dashboard.hub import Hub
from paani_services.dashboard.requests import BadRequestError, NoQuery, decode_query
from paani_services.dashboard.responses import json_response
from paani_services.dashboard.time_series import Series, columns_of

Moment = Annotated[int, msgspec.Meta(ge=0, le=2**53)]


class WindowQuery(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A window of the past [Unix us], both ends included."""

    from_us: Moment
    to_us: Moment


class PastRoutes:
    """Answers from the history."""

    def __init__(self, hub: Hub, history: History) -> None:
        self._hub, self._history = hub, history

    def routes(self) -> list[web.RouteDef]:
        return [web.get("/api/history", self._series), web.get("/api/history/frames", self._frames)]

    async def _series(self, request: web.Request) -> web.Response:
        decode_query(dict(request.query), NoQuery)
        samples = self._history.samples
        events = events_since(self._hub.events, samples[0].at_us) if samples else ()
        return json_response(Series(samples=columns_of(samples), events=events))

    async def _frames(self, request: web.Request) -> web.Response:
        return frames_response(self._history.window(*read_window(request)))


def read_window(request: web.Request) -> tuple[int, int]:
    """First and last moment asked for [Unix us]. Raises BadRequestError for one that is too long, or ends early."""
    wanted = decode_query(dict(request.query), WindowQuery)
    if not 0 <= wanted.to_us - wanted.from_us <= MAX_WINDOW_US:
        raise BadRequestError(f"to_us: expected at most {MAX_WINDOW_US // 1_000_000} s after from_us", "to_us")
    return wanted.from_us, wanted.to_us


def frames_response(packed: bytes) -> web.Response:
    """Frames one after the other, as `frames.pack_frames` makes them."""
    return web.Response(body=packed, content_type="application/octet-stream")
