"""The operator's process: what its clients ask of it, and what it says of itself."""

from __future__ import annotations

from enum import StrEnum

import msgspec

from paani.messages.guidance import Waypoint
from paani.messages.header import Count, Finite, Message, NonNegative, Signed, Stamp, Text
from paani.messages.mission import MissionRefusal


class DriveMode(StrEnum):
    """What the boat does while it is armed.

    ROUTE: follows its mission or route. HOLD: keeps the station where it was ordered to. RETURN: goes home, or to
    a rally point that is nearer, and keeps the station there. MANUAL: does what a hand says. IDLE: no thrust.
    """

    ROUTE = "ROUTE"
    HOLD = "HOLD"
    RETURN = "RETURN"
    MANUAL = "MANUAL"
    IDLE = "IDLE"


class RequestAct(StrEnum):
    """STOP: at once. HOLD: the button that arms is held, said again while it is. RELEASE: it was let go.

    MODE: another mode, which takes a wheel that nobody holds. WHEEL: takes the wheel, whoever holds it. DRIVE: what the
    hand says in MANUAL, said again at least every 0.3 s. OVERRIDE: in MANUAL the advice does not veto for 10 s.
    """

    STOP = "STOP"
    HOLD = "HOLD"
    RELEASE = "RELEASE"
    MODE = "MODE"
    WHEEL = "WHEEL"
    DRIVE = "DRIVE"
    OVERRIDE = "OVERRIDE"


class OperatorRequest(Message, frozen=True, kw_only=True):
    """What a client asks. `press`: a number of its own for each press of a button, the same while it is held or said
    again; of DRIVE one that grows with each set-point.

    `hand`: a number of its own for each hand of the client, as each page is. `surge` and `turn` of DRIVE: ahead and to
    port, each as a part of the most that MANUAL gives.
    """

    act: RequestAct
    press: Count = 0
    hand: Count = 0
    mode: DriveMode = DriveMode.IDLE
    surge: Signed = 0.0
    turn: Signed = 0.0


class ArmRefusal(StrEnum):
    """Why a press did not arm; NONE where it did.

    TOO_SHORT, TOO_LONG: how long it was held, by the operator's own clock. BROKEN: the client was silent meanwhile, or
    somebody else held. STOPPED: a STOP came meanwhile. LATCHED: this client may not release a STOP. NOT_WRITTEN: the
    latch cannot be written. NO_STATION: the page's process is not there, so nobody could stop the boat by it.
    """

    NONE = "NONE"
    TOO_SHORT = "TOO_SHORT"
    TOO_LONG = "TOO_LONG"
    BROKEN = "BROKEN"
    STOPPED = "STOPPED"
    LATCHED = "LATCHED"
    NOT_WRITTEN = "NOT_WRITTEN"
    NO_STATION = "NO_STATION"


class ModeRefusal(StrEnum):
    """Why the mode is not another one, or the wheel not in another hand; NONE where nothing stands in the way.

    NOT_HOLDER: another hand holds the wheel. NOT_ALLOWED: this client may only stop. NO_POSITION: the estimate is not
    healthy, or too old. NO_HOME: the boat was never free to move, and no mission names a home. NO_MISSION: there is
    neither a mission nor a route. NOT_ARMED: a hand may not drive before, so that arming never follows a stick.
    NOT_MANUAL: only in MANUAL is there a veto to override.
    """

    NONE = "NONE"
    NOT_HOLDER = "NOT_HOLDER"
    NOT_ALLOWED = "NOT_ALLOWED"
    NO_POSITION = "NO_POSITION"
    NO_HOME = "NO_HOME"
    NO_MISSION = "NO_MISSION"
    NOT_ARMED = "NOT_ARMED"
    NOT_MANUAL = "NOT_MANUAL"


class OverrideEnd(StrEnum):
    """Why the last override of the advice ended; NONE while one is in force, or before any.

    EXPIRED: its time was over. ORDERED: its hand ordered a mode. TAKEN: another hand took the wheel. SILENT: its hand
    was not heard for too long. DISARMED: the boat was stopped or disarmed.
    """

    NONE = "NONE"
    EXPIRED = "EXPIRED"
    ORDERED = "ORDERED"
    TAKEN = "TAKEN"
    SILENT = "SILENT"
    DISARMED = "DISARMED"


class BarredMode(msgspec.Struct, frozen=True, kw_only=True):
    """A mode that may not start now, whoever asks, and why."""

    mode: DriveMode
    refusal: ModeRefusal


class OperatorOrder(Message, frozen=True, kw_only=True):
    """The mode in force. It arms nothing.

    `source_us`: of MANUAL when the set-point was received, else now. `since_us`: when the mode was ordered, 0 for that
    of the start. `target`: the station of HOLD, or where RETURN leads to. `surge`, `turn`: what the hand says,
    ahead and to port. `by`, `hand`: who holds the wheel. `override`: the advice does not veto. `mission_us`:
    `accepted_us` of the mission that is in force; 0: none was accepted in this run of the operator's process.
    `map_latitude_deg`, `map_longitude_deg`: where the origin of the map lay on Earth in which target and mission were
    placed; 0: not known, or nothing was placed.
    """

    mode: DriveMode
    since_us: Stamp = 0
    target: tuple[Waypoint, ...] = ()
    surge: Signed = 0.0
    turn: Signed = 0.0
    by: Text = ""
    hand: Count = 0
    override: bool = False
    mission_us: Stamp = 0
    map_latitude_deg: Finite = 0.0
    map_longitude_deg: Finite = 0.0


class OperatorState(Message, frozen=True, kw_only=True):
    """Armed, or stopped until armed again.

    `by`: the client that armed or stopped last, empty before. `latch_kept`: what is on disk agrees, so that it outlives
    the process. `stops`: STOPs since it began; `asked_us`: the first of those that wait for, or had, the confirmation
    of zero thrust at `confirmed_us` (0: not yet). `held_ms`: how long the press of `hold_by` has been held; 0: none.
    `press_by`, `press`, `refusal`: the press that ended last.

    `mode`, `mode_since_us`: the mode in force, as in `OperatorOrder`. `wheel_by`, `wheel_hand`: who holds the wheel,
    empty while nobody does. `override_ms`: for how long the advice does not veto yet; `override_end`: why it
    vetoes again. `answered_by`, `answered`, `mode_refusal`: the request for a mode, the wheel or an override that was
    answered last. `barred`: modes that may not start now. `mission_us`: as in `OperatorOrder`. `mission_answered_by`,
    `mission_answered`, `mission_refusal`, `mission_fault`: the request for a mission that was answered last; of INVALID
    what is wrong, and where.
    """

    armed: bool
    stopped: bool
    by: Text = ""
    latch_kept: bool = True
    stops: Count = 0
    asked_us: Stamp = 0
    confirmed_us: Stamp = 0
    hold_by: Text = ""
    held_ms: NonNegative = 0.0
    press_by: Text = ""
    press: Count = 0
    refusal: ArmRefusal = ArmRefusal.NONE
    mode: DriveMode = DriveMode.ROUTE
    mode_since_us: Stamp = 0
    wheel_by: Text = ""
    wheel_hand: Count = 0
    override_ms: NonNegative = 0.0
    answered_by: Text = ""
    answered: Count = 0
    mode_refusal: ModeRefusal = ModeRefusal.NONE
    barred: tuple[BarredMode, ...] = ()
    mission_us: Stamp = 0
    mission_answered_by: Text = ""
    mission_answered: Count = 0
    mission_refusal: MissionRefusal = MissionRefusal.NONE
    mission_fault: Text = ""
    override_end: OverrideEnd = OverrideEnd.NONE
