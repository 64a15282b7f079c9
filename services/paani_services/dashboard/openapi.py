"""`/openapi.json`: every route of the server, generated from the types that requests and answers are coded by. Pure."""

from __future__ import annotations

import functools
import re
from typing import Any, NamedTuple

import msgspec

from paani import keys
from paani import messages as m
from paani.board_status import STATUS_PATH, BoardStatus
from paani.version import version_text
from paani_services.dashboard import answers as a
from paani_services.dashboard import (
    driving,
    past,
    process_logs,
    recording_routes,
    recordings,
    requests,
    settings_rows,
    tiles,
    time_series,
    tuning,
)
from paani_services.dashboard.gatekeeper import KEY_HEADER, LoginRequest
from paani_services.dashboard.missions import MissionBody
from paani_services.dashboard.picture_stream import MEDIA_TYPE

REF = "#/components/schemas/{name}"
JPEG, TEXT, HTML, BYTES = "image/jpeg", "text/plain", "text/html", "application/octet-stream"


class Operation(NamedTuple):
    """One route. `answer`: the type of a JSON answer with status 200, or the media type of another.

    `errors`: statuses besides 400, which a malformed request gets. `query`: the type of its parameters. `is_open`: it
    asks for neither key nor session.
    """

    method: str
    path: str
    summary: str
    answer: Any
    body: type[Any] | None = None
    query: type[Any] = requests.NoQuery
    errors: tuple[int, ...] = ()
    is_open: bool = False


ACT = (401, 403)
ASK = (*ACT, 409, 503)
READ = (401, 404, 409, 503)
KEEP = (*ACT, 404, 409, 500)
OPERATIONS = (
    Operation("get", "/", "The page.", HTML, errors=(303,)),
    Operation("get", "/static/{name}", "A file of the page.", HTML, errors=(404,), is_open=True),
    Operation("get", "/ws", "WebSocket; a frame is u8 and u16 lengths, key, header, body.", TEXT, errors=ACT),
    Operation("get", "/snapshot.jpg", "The newest picture.", JPEG, query=requests.SnapshotQuery, errors=(401, 503)),
    Operation("get", "/stream.mjpg", "Pictures as they come.", MEDIA_TYPE, errors=(401, 503)),
    Operation("get", "/healthz", "Whether this process serves.", a.LifeAnswer, is_open=True),
    Operation("get", "/readyz", "Whether every process is there and ready.", a.ReadyAnswer, errors=(401, 503)),
    Operation("get", "/metrics", "For Prometheus; every name begins with paani_.", TEXT, errors=(401, 501)),
    Operation("get", "/openapi.json", "This list.", dict[str, Any], errors=(401,)),
    Operation("get", "/api/topics", "The topics of the bus.", list[a.TopicRow], errors=(401,)),
    Operation("get", STATUS_PATH, "What the boat sees, advises and runs.", BoardStatus, errors=(401,)),
    Operation("get", "/api/session", "Whether a login is asked.", a.SessionAnswer, errors=(401,)),
    Operation("post", "/api/stop", "STOP, by anybody, with any body.", a.StopAnswer, errors=(503,), is_open=True),
    Operation(
        "post",
        "/api/arm/hold",
        "The button is held.",
        a.HeldAnswer,
        requests.PressRequest,
        errors=(*ACT, 409),
    ),
    Operation("post", "/api/arm/release", "It was let go: arm.", a.ArmedAnswer, requests.PressRequest, errors=ASK),
    Operation("post", "/api/drive/mode", "Order a mode.", a.DoneAnswer, driving.ModeRequest, errors=ASK),
    Operation("post", "/api/drive/wheel", "Take the wheel.", a.DoneAnswer, driving.HandRequest, errors=ASK),
    Operation("post", "/api/drive/override", "Override the advice.", a.DoneAnswer, driving.HandRequest, errors=ASK),
    Operation("post", "/api/drive/setpoint", "What the hand says.", a.SentAnswer, driving.SetpointRequest, errors=ACT),
    Operation("get", "/api/history", "Samples and events of the last ten minutes.", time_series.Series, errors=(401,)),
    Operation(
        "get",
        "/api/history/frames",
        "What pages were sent then: frames as of the WebSocket, each after its length as u32.",
        BYTES,
        query=past.WindowQuery,
        errors=(401,),
    ),
    Operation("get", "/api/settings", "What it runs with.", list[settings_rows.SettingRow], errors=(401,)),
    Operation("get", "/api/recordings", "Which there are.", recordings.RecordingList, errors=(401,)),
    Operation("get", "/api/recordings/{name}/file", "One, as it is.", BYTES, errors=(401, 404)),
    Operation("get", "/api/recordings/{name}/series", "Its samples and events.", time_series.Series, errors=READ),
    Operation(
        "get",
        "/api/recordings/{name}/frames",
        "What a page is given of it, as of the history.",
        BYTES,
        query=past.WindowQuery,
        errors=READ,
    ),
    Operation(
        "get", "/api/replayed/series", "Samples and events of what is replayed.", time_series.Series, errors=READ
    ),
    Operation("get", "/api/replayed/frames", "Its frames.", BYTES, query=past.WindowQuery, errors=READ),
    Operation(
        "post",
        "/api/recordings/protect",
        "Keep one whatever the budget, or no longer.",
        a.DoneAnswer,
        recording_routes.ProtectRequest,
        errors=KEEP,
    ),
    Operation(
        "post",
        "/api/recordings/delete",
        "Delete one that is neither protected nor being written.",
        a.DoneAnswer,
        recording_routes.RecordingRequest,
        errors=KEEP,
    ),
    Operation("get", "/api/tiles", "Zoom levels of the chart.", tiles.TileSet, errors=(401, 409)),
    Operation("get", "/tiles/{zoom}/{column}/{row}", "A tile; 204: none.", BYTES, errors=(401, 404, 409, 500)),
    Operation("get", "/api/logs/{service}", "The last lines of a log.", process_logs.LogLines, errors=(401, 404, 500)),
    Operation("post", "/api/mission", "Another mission and fence.", a.DoneAnswer, MissionBody, errors=(408, *ASK)),
    Operation("get", "/api/tune", "What is tuned.", m.Shadow, errors=(401, 503)),
    Operation("post", "/api/tune/propose", "Try in the shadow.", m.Shadow, tuning.ProposeRequest, errors=ASK),
    Operation("post", "/api/tune/promote", "Put them in force.", m.Shadow, tuning.ProposalRequest, errors=ASK),
    Operation("post", "/api/tune/rollback", "Take them back.", m.Shadow, tuning.ProposalRequest, errors=ASK),
)
LOGIN_OPERATIONS = (
    Operation("get", "/login", "The login, where other machines reach the page.", HTML, is_open=True),
    Operation("post", "/api/login", "Begin a session.", a.DoneAnswer, LoginRequest, errors=(403, 408), is_open=True),
    Operation("post", "/api/logout", "End it.", a.DoneAnswer, errors=ACT),
)
WORDS = {
    303: "to the login",
    400: "malformed, and where",
    401: "log in first",
    403: "wrong origin, host or key",
    404: "no such file",
    408: "the request did not come to its end",
    409: "refused, and why",
    500: "it cannot be read or written, and why",
    501: "an extra is not installed",
    503: "nobody answers, or nothing is there",
}


@functools.cache
def openapi_document() -> dict[str, Any]:
    """The document, OpenAPI 3.1, for a server of either kind: with a login or without."""
    everything = (*OPERATIONS, *LOGIN_OPERATIONS)
    messages = {topic.name: topic.type for topic in keys.TOPICS if topic.stance is not keys.Stance.PICTURE}
    types = [each.answer for each in everything if not isinstance(each.answer, str)]
    types += [each.body for each in everything if each.body is not None] + [a.ErrorAnswer, *messages.values()]
    schemas, components = msgspec.json.schema_components(types, ref_template=REF)
    schema_of = {repr(kind): schema for kind, schema in zip(types, schemas, strict=True)}
    paths: dict[str, dict[str, Any]] = {}
    for each in everything:
        paths.setdefault(each.path, {})[each.method] = _operation(each, schema_of)
    return {
        "openapi": "3.1.0",
        "info": {"title": "PAANI", "version": version_text(), "description": "The page's server."},
        "paths": paths,
        "x-topics": {name: schema_of[repr(kind)] for name, kind in messages.items()},
        "components": {
            "schemas": components,
            "securitySchemes": {
                "key": {"type": "apiKey", "in": "header", "name": KEY_HEADER, "description": "The operator's key."},
                "session": {
                    "type": "apiKey",
                    "in": "cookie",
                    "name": "__Host-paani-PORT",
                    "description": "Of a login.",
                },
            },
        },
    }


def _operation(each: Operation, schema_of: dict[str, Any]) -> dict[str, Any]:
    is_text = isinstance(each.answer, str)
    answer = {each.answer: {}} if is_text else {"application/json": {"schema": schema_of[repr(each.answer)]}}
    error = {"application/json": {"schema": schema_of[repr(a.ErrorAnswer)]}}
    found: dict[str, Any] = {
        "summary": each.summary,
        "operationId": f"{each.method} {each.path}",
        "security": [{}] if each.is_open else [{"key": []}, {"session": []}],
        "parameters": _parameters(each),
        "responses": {"200": {"description": "done", "content": answer}},
    }
    for status in (400, *each.errors):
        content = answer if each.answer is a.ReadyAnswer and status == 503 else error
        found["responses"][str(status)] = {"description": WORDS[status], "content": {} if status == 303 else content}
    if each.body is not None:
        found["requestBody"] = {
            "required": True,
            "content": {"application/json": {"schema": schema_of[repr(each.body)]}},
        }
    return found


def _parameters(each: Operation) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = [
        {"name": field.encode_name, "in": "query", "schema": msgspec.json.schema(field.type)}
        for field in msgspec.structs.fields(each.query)
    ]
    return found + [
        {"name": name, "in": "path", "required": True, "schema": {"type": "string"}}
        for name in re.findall(r"{(\w+)}", each.path)
    ]
