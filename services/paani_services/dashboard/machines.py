"""What programs ask the page's server for: life, readiness, metrics, topics, status, pictures, and how to ask."""

from __future__ import annotations

from aiohttp import web

from paani import keys
from paani import messages as m
from paani.board_status import STATUS_PATH
from paani.bus import Picture
from paani.clock import Clock
from paani.config import Config
from paani.extras import missing_module
from paani.operator_client import OperatorClient
from paani_services.dashboard.answers import LifeAnswer, ReadyAnswer, TopicRow
from paani_services.dashboard.gatekeeper import Gatekeeper
from paani_services.dashboard.hub import Hub
from paani_services.dashboard.openapi import openapi_document
from paani_services.dashboard.pages import SECURITY_HEADERS
from paani_services.dashboard.picture_stream import PictureStreams
from paani_services.dashboard.readiness import find_unready
from paani_services.dashboard.requests import NoQuery, SnapshotQuery, decode_query
from paani_services.dashboard.responses import error_response, json_response
from paani_services.dashboard.status import board_status


class Machines:
    """Reads the hub; it changes nothing."""

    def __init__(
        self, hub: Hub, operator: OperatorClient, clock: Clock, config: Config, gatekeeper: Gatekeeper
    ) -> None:
        self._hub, self._operator, self._clock, self._config = hub, operator, clock, config
        self._gatekeeper, self._streams = gatekeeper, PictureStreams(hub, SECURITY_HEADERS)

    def routes(self) -> list[web.RouteDef]:
        return [
            web.get("/snapshot.jpg", self._snapshot),
            web.get("/stream.mjpg", self._stream, allow_head=False),
            web.get("/healthz", self._healthz),
            web.get("/readyz", self._readyz),
            web.get("/metrics", self._metrics),
            web.get("/openapi.json", self._openapi),
            web.get("/api/topics", self._topics),
            web.get(STATUS_PATH, self._status),
        ]

    async def _snapshot(self, request: web.Request) -> web.Response:
        wanted = decode_query(dict(request.query), SnapshotQuery)
        value, received_us = self._hub.newest(keys.PICTURE.name) or (None, 0)
        age_s = (self._clock.now_us() - received_us) * 1e-6
        if not isinstance(value, Picture) or age_s > wanted.max_age_s:
            return error_response(
                503, f"{keys.PICTURE.name}: no picture younger than {wanted.max_age_s:g} s", "max_age_s"
            )
        headers = {"X-Age-S": f"{age_s:.3f}", "X-Frame-Id": f"{value.header.frame_epoch}.{value.header.frame_seq}"}
        return web.Response(body=value.data, content_type=value.header.media_type, headers=headers)

    async def _stream(self, request: web.Request) -> web.StreamResponse:
        decode_query(dict(request.query), NoQuery)
        return await self._streams.serve(request, lambda: self._gatekeeper.may_watch(request))

    async def _openapi(self, request: web.Request) -> web.Response:
        decode_query(dict(request.query), NoQuery)
        return json_response(openapi_document())

    async def _healthz(self, request: web.Request) -> web.Response:
        decode_query(dict(request.query), NoQuery)
        state = self._operator.state
        armed, stopped = (None, None) if state is None else (state.armed, state.stopped)
        return json_response(LifeAnswer(True, len(self._hub.clients), armed, stopped))

    async def _readyz(self, request: web.Request) -> web.Response:
        decode_query(dict(request.query), NoQuery)
        unready = find_unready(self._hub, self._config.services, self._clock.now_us())
        return json_response(ReadyAnswer(not unready, unready), 503 if unready else 200)

    async def _metrics(self, request: web.Request) -> web.Response:
        decode_query(dict(request.query), NoQuery)
        try:
            from paani_services.dashboard.metrics import CONTENT_TYPE, metrics_text  # noqa: PLC0415  # of an extra
        except ModuleNotFoundError as error:
            if (remedy := missing_module("/metrics", error)) is None:
                raise
            return error_response(501, str(remedy), request.path)
        text = metrics_text(self._hub, self._config, self._clock.now_us())
        return web.Response(body=text, headers={"Content-Type": CONTENT_TYPE})

    async def _topics(self, request: web.Request) -> web.Response:
        decode_query(dict(request.query), NoQuery)
        return json_response([topic_row(topic) for topic in keys.TOPICS])

    async def _status(self, request: web.Request) -> web.Response:
        decode_query(dict(request.query), NoQuery)
        return json_response(board_status(self._hub, self._config.profile, self._clock.now_us()))


def topic_row(topic: keys.Topic[m.Message]) -> TopicRow:
    """One row of the table of topics."""
    return TopicRow(
        name=topic.name,
        type=topic.type.__name__,
        producer=keys.producers_text(topic),
        rate_hz=topic.rate_hz,
        fresh_s=topic.fresh_s,
        stance=topic.stance.value,
        summary=topic.summary,
    )
