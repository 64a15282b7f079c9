"""Requests of the page that drive the boat: the mode, the wheel, what its hand says, and an override of the advice.

Each page is a hand of its own, by a number that it keeps while its tab lasts. What the hand says in MANUAL is passed on
as it comes: how old it may be is the operator's process's to say.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Annotated

import msgspec
from aiohttp import web

from paani import messages as m
from paani.operator_client import OperatorClient
from paani_services.dashboard.answers import DoneAnswer, SentAnswer
from paani_services.dashboard.operator_events import MODE_REFUSALS
from paani_services.dashboard.requests import MAX_PRESS, decode_body
from paani_services.dashboard.responses import error_response, json_response

ANSWER_TIMEOUT_S = 1.0

Refuse = Callable[[web.Request, str], web.Response | None]
Number = Annotated[int, msgspec.Meta(ge=1, le=MAX_PRESS)]
Part = Annotated[float, msgspec.Meta(ge=-1.0, le=1.0)]


class HandRequest(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """`hand`: the page's own number."""

    hand: Number


class ModeRequest(HandRequest, frozen=True, forbid_unknown_fields=True):
    """The mode that this hand asks for."""

    mode: m.DriveMode


class SetpointRequest(HandRequest, frozen=True, forbid_unknown_fields=True):
    """What the hand says, ahead and to port. `number` grows with each: one that was overtaken is passed over."""

    number: Number
    surge: Part
    turn: Part


class Driving:
    """`refuse`: the error response to a request that is not from the operator's own page, else None."""

    def __init__(self, operator: OperatorClient, refuse: Refuse) -> None:
        self._operator, self._refuse = operator, refuse

    def routes(self) -> list[web.RouteDef]:
        return [
            web.post("/api/drive/mode", self._mode),
            web.post("/api/drive/wheel", self._wheel),
            web.post("/api/drive/override", self._override),
            web.post("/api/drive/setpoint", self._setpoint),
        ]

    async def _mode(self, request: web.Request) -> web.Response:
        if (refused := self._refuse(request, "drive")) is not None:
            return refused
        wanted = decode_body(await request.read(), ModeRequest)
        return await _answer(self._operator.set_mode(wanted.mode, ANSWER_TIMEOUT_S, wanted.hand), "mode")

    async def _wheel(self, request: web.Request) -> web.Response:
        if (refused := self._refuse(request, "drive")) is not None:
            return refused
        hand = decode_body(await request.read(), HandRequest).hand
        return await _answer(self._operator.take_wheel(ANSWER_TIMEOUT_S, hand), "wheel")

    async def _override(self, request: web.Request) -> web.Response:
        if (refused := self._refuse(request, "drive")) is not None:
            return refused
        hand = decode_body(await request.read(), HandRequest).hand
        return await _answer(self._operator.override(ANSWER_TIMEOUT_S, hand), "override")

    async def _setpoint(self, request: web.Request) -> web.Response:
        if (refused := self._refuse(request, "drive")) is not None:
            return refused
        wanted = decode_body(await request.read(), SetpointRequest)
        self._operator.drive(wanted.surge, wanted.turn, wanted.hand, wanted.number)
        return json_response(SentAnswer(True))


async def _answer(asking: Awaitable[m.ModeRefusal | None], field: str) -> web.Response:
    """What the operator's process made of a request."""
    refusal = await asking
    if refusal is None:
        return error_response(503, "not done: the operator's process does not answer", field)
    if refusal is not m.ModeRefusal.NONE:
        return error_response(409, f"not done: {MODE_REFUSALS[refusal]}", field)
    return json_response(DoneAnswer(True))
