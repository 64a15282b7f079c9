"""Takes a mission that was drawn, its fence and rally points to the operator's process, and tells its answer."""

from __future__ import annotations

import asyncio

from aiohttp import web

from paani import messages as m
from paani.mission_client import MISSION_REFUSALS, MissionClient
from paani.missions import MAX_CORNERS, MAX_LEGS, MAX_WAYPOINTS
from paani_services.dashboard.answers import DoneAnswer
from paani_services.dashboard.driving import HandRequest, Refuse
from paani_services.dashboard.requests import decode_body
from paani_services.dashboard.responses import error_response, json_response

POINT_BYTES = 64  # of a waypoint or corner in JSON, with all digits of both numbers
MAX_BODY_BYTES = POINT_BYTES * (MAX_WAYPOINTS + MAX_CORNERS) + 1024 * MAX_LEGS
BODY_TIMEOUT_S = 20.0  # a phone far from the shore sends no faster
ANSWER_TIMEOUT_S = 20.0


class MissionBody(HandRequest, frozen=True, forbid_unknown_fields=True):
    """Legs, fence and rally points that are to take the place of those in force, whole; without `rally` those stay."""

    name: m.Text = ""
    legs: tuple[m.MissionLeg, ...] = ()
    fence: tuple[m.FenceArea, ...] = ()
    rally: tuple[m.Waypoint, ...] | None = None


class Missions:
    """`refuse`: the error response to a request that is not from the operator's own page, else None."""

    def __init__(self, client: MissionClient, refuse: Refuse) -> None:
        self._client, self._refuse = client, refuse

    def routes(self) -> list[web.RouteDef]:
        return [web.post("/api/mission", self._send)]

    async def _send(self, request: web.Request) -> web.Response:
        if (refused := self._refuse(request, "send a mission")) is not None:
            return refused
        try:
            async with asyncio.timeout(BODY_TIMEOUT_S):
                body = await request.clone(client_max_size=MAX_BODY_BYTES).read()
        except TimeoutError:
            return error_response(408, "the request did not come to its end", "body")
        wanted = decode_body(body, MissionBody)
        answer = await self._client.send(
            wanted.name, legs=wanted.legs, fence=wanted.fence, rally=wanted.rally,
            timeout_s=ANSWER_TIMEOUT_S, hand=wanted.hand,
        )  # fmt: skip
        if answer is None:
            return error_response(503, "not accepted: the operator's process does not answer", "mission")
        if answer.refusal is not m.MissionRefusal.NONE:
            why = answer.fault or MISSION_REFUSALS[answer.refusal]
            return error_response(409, f"not accepted: {why}", "mission")
        return json_response(DoneAnswer(True))
