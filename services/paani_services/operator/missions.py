"""Missions that clients send: whether one may be accepted now, and what is in force after it. Pure.

Nothing begins to move because of a mission: it is accepted where the boat is not armed or not in ROUTE, and its fence
where the boat is not armed or in IDLE. Whoever wants it followed orders ROUTE after that.
"""

from __future__ import annotations

import msgspec
from msgspec.structs import replace

from paani import messages as m
from paani.messages import DriveMode, MissionRefusal

NO_MISSION = m.Mission(source_us=0, name="", legs=())


class MissionAnswer(msgspec.Struct, frozen=True):
    """The request of a client that was answered last, and how."""

    client: str = ""
    press: int = 0
    refusal: MissionRefusal = MissionRefusal.NONE
    fault: str = ""


class Situation(msgspec.Struct, frozen=True, kw_only=True):
    """What the answer depends on. `present`: the mission in force, None where that is not known.

    `may_steer`: nobody holds the wheel, or this client's hand does. `is_arming`: a button is held that would arm.
    """

    mode: DriveMode
    armed: bool
    present: m.Mission | None
    may_steer: bool
    is_arming: bool = False


def find_refusal(request: m.MissionRequest, situation: Situation) -> MissionRefusal:
    """Why what this request asks for may not be in force now; NONE where it may, once it is checked."""
    if not situation.may_steer:
        return MissionRefusal.NOT_HOLDER
    if situation.is_arming:
        return MissionRefusal.BUSY
    if situation.present is None:
        return MissionRefusal.NOT_KNOWN
    if situation.armed and situation.mode is DriveMode.ROUTE:
        return MissionRefusal.UNDER_WAY
    has_other_fence = not request.keep_fence and request.fence != situation.present.fence
    if situation.armed and situation.mode is not DriveMode.IDLE and has_other_fence:
        return MissionRefusal.FENCE_IN_USE
    return MissionRefusal.NONE


def merge(request: m.MissionRequest, present: m.Mission, now_us: int) -> m.Mission:
    """The mission in force after this request. Its stamp is later than that of the present one."""
    accepted_us = max(now_us, present.accepted_us + 1)
    return m.Mission(
        source_us=accepted_us,
        name=present.name if request.keep_legs else request.name,
        legs=present.legs if request.keep_legs else request.legs,
        fence=present.fence if request.keep_fence else request.fence,
        rally=present.rally if request.keep_rally else request.rally,
        home=present.home,
        land=present.land,
        accepted_us=accepted_us,
        legs_us=present.legs_us if request.keep_legs else accepted_us,
    )


def with_missions(state: m.OperatorState, accepted: m.Mission, answer: MissionAnswer) -> m.OperatorState:
    """What everybody else is told of it, added to the operator's state."""
    return replace(
        state,
        mission_us=accepted.accepted_us,
        mission_answered_by=answer.client,
        mission_answered=answer.press,
        mission_refusal=answer.refusal,
        mission_fault=answer.fault[:400],
    )
