"""Answers of the dashboard's server: JSON, and errors with a text and the field at fault."""

from __future__ import annotations

import msgspec
from aiohttp import web

from paani_services.dashboard.answers import ErrorAnswer


def json_response(value: object, status: int = 200) -> web.Response:
    """The value as JSON."""
    return web.Response(status=status, body=msgspec.json.encode(value), content_type="application/json")


def error_response(status: int, text: str, field: str) -> web.Response:
    """An error: what is wrong, and where."""
    return json_response(ErrorAnswer(text, field), status)
