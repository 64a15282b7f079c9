"""The operator's process: what its clients ask of it, and what it says of itself."""

from __future__ import annotations

from enum import StrEnum

from paani.messages.header import Count, Message, NonNegative, Stamp, Text


class RequestAct(StrEnum):
    """STOP: at once. HOLD: the button that arms is held, said again while it is. RELEASE: it was let go."""

    STOP = "STOP"
    HOLD = "HOLD"
    RELEASE = "RELEASE"


class OperatorRequest(Message, frozen=True, kw_only=True):
    """What a client asks. `press`: a number of its own for each press of the button, the same while it is held."""

    act: RequestAct
    press: Count = 0


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


class OperatorState(Message, frozen=True, kw_only=True):
    """Armed, or stopped until armed again.

    `by`: the client that armed or stopped last, empty before. `latch_kept`: what is on disk agrees, so that it outlives
    the process. `stops`: STOPs since it began; `asked_us`: the first of those that wait for, or had, the confirmation
    of zero thrust at `confirmed_us` (0: not yet). `held_ms`: how long the press of `hold_by` has been held; 0: none.
    `press_by`, `press`, `refusal`: the press that ended last.
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
