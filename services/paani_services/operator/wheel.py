"""The wheel: which mode is in force, who may order another, and what a hand says in MANUAL. Pure.

A mode arms nothing. MANUAL lasts while its hand keeps saying so and the boat is armed; it ends in IDLE, from where only
a request leads on. Nothing enters MANUAL but a request of whoever holds the wheel.
"""

from __future__ import annotations

import msgspec
from msgspec.structs import replace

from paani import messages as m
from paani.keys import STOPPING_CLIENTS
from paani.map_origin import MapPlace
from paani.messages import DriveMode, ModeRefusal, OverrideEnd, RequestAct
from paani_services.operator.missions import NO_MISSION
from paani_services.operator.return_place import choose_place

# A deflected stick that nobody says again is let go after this: thrust is zero within 0.5 s of the last word.
DEFLECTED_MAX_S = 0.3
NEUTRAL_MAX_S = 2.0  # a stick in neutral gives no thrust, so its hand may be silent for longer
OVERRIDE_S = 10.0
ANSWERS = 16  # of clients that may ask again: each does so for a second, every tenth of it


class Facts(msgspec.Struct, frozen=True):
    """What a mode needs: a trusted position, home, and a mission or a route; None or false where there is none.

    `mission`: the one in force, without legs where there is none; None where that is not known. `occupancy`: what the
    boat has seen around it, None where that is not fresh. `margin_m`: the least distance of a place from the fence.
    `map_place`: by which the map is known that places lie in; None without a trusted position.
    """

    position: m.Waypoint | None = None
    home: m.Waypoint | None = None
    has_mission: bool = False
    mission: m.Mission | None = None
    occupancy: m.OccupancyGrid | None = None
    margin_m: float = 0.0
    map_place: MapPlace | None = None


class Stick(msgspec.Struct, frozen=True):
    """What the hand said last: `surge` ahead, `turn` to port, when that came [us], and the number of the set-point."""

    surge: float = 0.0
    turn: float = 0.0
    received_us: int = 0
    number: int = 0

    @property
    def is_neutral(self) -> bool:
        """Whether it asks for no thrust."""
        return self.surge == 0.0 and self.turn == 0.0


class Answer(msgspec.Struct, frozen=True):
    """A request that was answered, and how."""

    client: str = ""
    press: int = 0
    refusal: ModeRefusal = ModeRefusal.NONE


class Wheel(msgspec.Struct, frozen=True, kw_only=True):
    """`since_us`: when the mode was ordered. `by`, `hand`: who holds the wheel. `override_until_us`: 0 without one.

    `override_end`: why there is none any more. `answer`: what is told now. `answers`: those that may be told again.
    """

    mode: DriveMode = DriveMode.ROUTE
    since_us: int = 0
    target: tuple[m.Waypoint, ...] = ()
    by: str = ""
    hand: int = 0
    stick: Stick = Stick()
    override_until_us: int = 0
    override_end: OverrideEnd = OverrideEnd.NONE
    answer: Answer = Answer()
    answers: tuple[Answer, ...] = ()


def find_bar(mode: DriveMode, facts: Facts, *, armed: bool) -> ModeRefusal:
    """Why this mode may not start now, whoever asks; NONE where it may."""
    match mode:
        case DriveMode.ROUTE if not facts.has_mission:
            return ModeRefusal.NO_MISSION
        case DriveMode.HOLD | DriveMode.RETURN if facts.position is None:
            return ModeRefusal.NO_POSITION
        case DriveMode.RETURN if facts.home is None:
            return ModeRefusal.NO_HOME
        case DriveMode.MANUAL if not armed:
            return ModeRefusal.NOT_ARMED
    return ModeRefusal.NONE


def answer(wheel: Wheel, client: str, request: m.OperatorRequest, facts: Facts, now_us: int, *, armed: bool) -> Wheel:
    """The wheel after a request; DRIVE has no answer.

    A request that is said again, as its answer gave way to that of another, is told the same and does nothing.
    """
    if request.act is RequestAct.DRIVE:
        return drive(lapse(wheel, now_us, armed=armed), client, request, now_us)
    for given in wheel.answers:
        if (given.client, given.press) == (client, request.press):
            return replace(wheel, answer=given)
    refusal = _find_refusal(wheel, client, request, facts, armed=armed)
    if refusal is ModeRefusal.NONE:
        match request.act:
            case RequestAct.MODE:
                wheel = _begin_mode(wheel, client, request, facts, now_us)
            case RequestAct.WHEEL:
                wheel = _take(wheel, client, request.hand, now_us)
            case RequestAct.OVERRIDE:
                until_us = now_us + round(OVERRIDE_S * 1e6)
                wheel = replace(wheel, override_until_us=until_us, override_end=OverrideEnd.NONE)
    given = Answer(client, request.press, refusal)
    return replace(wheel, answer=given, answers=(given, *wheel.answers[: ANSWERS - 1]))


def drive(wheel: Wheel, client: str, request: m.OperatorRequest, now_us: int) -> Wheel:
    """Take a set-point in MANUAL from the hand at the wheel; one that came late, after a newer one, is passed over."""
    is_newer = request.press > wheel.stick.number
    if wheel.mode is not DriveMode.MANUAL or not _holds(wheel, client, request.hand) or not is_newer:
        return wheel
    return replace(wheel, stick=Stick(request.surge, request.turn, now_us, request.press))


def lapse(wheel: Wheel, now_us: int, *, armed: bool) -> Wheel:
    """What time changes: MANUAL ends where its hand is silent for too long or the boat is not armed; so do overrides.

    A clock that is set back is silence too.
    """
    if wheel.override_until_us and not is_overridden(wheel, now_us):
        wheel = replace(wheel, override_until_us=0, override_end=OverrideEnd.EXPIRED)
    if wheel.mode is DriveMode.MANUAL and not armed:
        return _rest(wheel, now_us, OverrideEnd.DISARMED)
    if wheel.mode is DriveMode.MANUAL and _is_silent(wheel.stick, now_us):
        return _rest(wheel, now_us, OverrideEnd.SILENT)
    return wheel


def is_overridden(wheel: Wheel, now_us: int) -> bool:
    """Whether the advice does not veto now."""
    return 0 < wheel.override_until_us - now_us <= round(OVERRIDE_S * 1e6)


def order_message(wheel: Wheel, now_us: int, *, armed: bool) -> m.OperatorOrder:
    """What the navigator is told now; a set-point that is too old is none."""
    wheel = lapse(wheel, now_us, armed=armed)
    return m.OperatorOrder(
        source_us=wheel.stick.received_us if wheel.mode is DriveMode.MANUAL else now_us,
        mode=wheel.mode,
        since_us=wheel.since_us,
        target=wheel.target,
        surge=wheel.stick.surge,
        turn=wheel.stick.turn,
        by=wheel.by,
        hand=wheel.hand,
        override=wheel.override_until_us > 0,
    )


def with_wheel(state: m.OperatorState, wheel: Wheel, facts: Facts, now_us: int) -> m.OperatorState:
    """What everybody else is told of the wheel, added to the operator's state."""
    bars = {mode: find_bar(mode, facts, armed=state.armed) for mode in DriveMode}
    return replace(
        state,
        mode=wheel.mode,
        mode_since_us=wheel.since_us,
        wheel_by=wheel.by,
        wheel_hand=wheel.hand,
        override_ms=(wheel.override_until_us - now_us) * 1e-3 if is_overridden(wheel, now_us) else 0.0,
        override_end=wheel.override_end,
        answered_by=wheel.answer.client,
        answered=wheel.answer.press,
        mode_refusal=wheel.answer.refusal,
        barred=tuple(m.BarredMode(mode=mode, refusal=bar) for mode, bar in bars.items() if bar is not ModeRefusal.NONE),
    )


def _find_refusal(wheel: Wheel, client: str, request: m.OperatorRequest, facts: Facts, *, armed: bool) -> ModeRefusal:
    """Why this request changes nothing; NONE where it may."""
    if client in STOPPING_CLIENTS:
        return ModeRefusal.NOT_ALLOWED
    if request.act is RequestAct.WHEEL:
        return ModeRefusal.NONE
    if wheel.by and not _holds(wheel, client, request.hand):
        return ModeRefusal.NOT_HOLDER
    if request.act is RequestAct.MODE:
        return find_bar(request.mode, facts, armed=armed)
    return ModeRefusal.NONE if wheel.mode is DriveMode.MANUAL else ModeRefusal.NOT_MANUAL


def _holds(wheel: Wheel, client: str, hand: int) -> bool:
    return (wheel.by, wheel.hand) == (client, hand)


def _begin_mode(wheel: Wheel, client: str, request: m.OperatorRequest, facts: Facts, now_us: int) -> Wheel:
    """The mode begins, with the stick in neutral."""
    wheel = _take(wheel, client, request.hand, now_us)
    return replace(
        _rest(wheel, now_us, OverrideEnd.ORDERED), mode=request.mode, target=_find_target(request.mode, facts)
    )


def _find_target(mode: DriveMode, facts: Facts) -> tuple[m.Waypoint, ...]:
    """The station of HOLD, and the place that RETURN leads to, as they are now."""
    if facts.position is None:
        return ()
    if mode is DriveMode.HOLD:
        return (facts.position,)
    if mode is not DriveMode.RETURN or facts.home is None:
        return ()
    mission = facts.mission or NO_MISSION
    return (choose_place(facts.position, facts.home, mission, facts.occupancy, facts.margin_m),)


def _take(wheel: Wheel, client: str, hand: int, now_us: int) -> Wheel:
    """The wheel in this hand. What another has driven by hand ends; every other mode goes on."""
    if _holds(wheel, client, hand):
        return wheel
    if wheel.mode is DriveMode.MANUAL:
        wheel = _rest(wheel, now_us, OverrideEnd.TAKEN)
    return replace(wheel, by=client, hand=hand, stick=Stick())


def _rest(wheel: Wheel, now_us: int, end: OverrideEnd) -> Wheel:
    """No thrust, and the stick let go. Its number stays, so that a set-point still under way is not taken.

    end: why an override ends, where one is in force.
    """
    if wheel.override_until_us:
        wheel = replace(wheel, override_until_us=0, override_end=end)
    stick = Stick(received_us=now_us, number=wheel.stick.number)
    return replace(wheel, mode=DriveMode.IDLE, since_us=now_us, target=(), stick=stick)


def _is_silent(stick: Stick, now_us: int) -> bool:
    limit_s = NEUTRAL_MAX_S if stick.is_neutral else DEFLECTED_MAX_S
    return not 0 <= now_us - stick.received_us <= round(limit_s * 1e6)
