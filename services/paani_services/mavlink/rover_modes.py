"""The numbers of ArduRover's modes, and which of them the boat is in. Pure."""

from __future__ import annotations

from enum import IntEnum

from paani_services.mavlink.snapshot import Snapshot


class Mode(IntEnum):
    """`custom_mode` of a rover: https://ardupilot.org/rover/docs/parameters.html#mode1."""

    MANUAL = 0
    HOLD = 4
    AUTO = 10
    RTL = 11


def mode_of(snapshot: Snapshot) -> Mode:
    """AUTO while the boat is armed and does its mission; HOLD while it is not armed."""
    return Mode.AUTO if snapshot.is_armed else Mode.HOLD
