"""When a button asks for STOP. Pure."""

from __future__ import annotations

import msgspec

from paani import messages as m


class Asking(msgspec.Struct, frozen=True):
    """`why`: what the button said at the last look. `waits`: a press that nobody has latched yet."""

    why: str = ""
    waits: bool = False


def look(asking: Asking, why: str) -> Asking:
    """The button was looked at: a press waits until it is latched, however soon it is let go."""
    return Asking(why=why, waits=asking.waits or (bool(why) and not asking.why))


def has_to_ask(asking: Asking, operator: m.OperatorState | None) -> bool:
    """Whether STOP is to be asked for now: for a press that waits, and while the button is down or unreadable whenever
    the boat is not stopped or somebody holds the button that arms; whose hold a STOP ends.
    """
    if asking.waits or operator is None:
        return asking.waits or bool(asking.why)
    return bool(asking.why) and (not operator.stopped or bool(operator.hold_by))


def answered(asking: Asking) -> Asking:
    """The STOP is latched."""
    return Asking(why=asking.why)
