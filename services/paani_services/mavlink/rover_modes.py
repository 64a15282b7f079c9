"""The numbers of ArduRover's modes, and the operator's modes that they stand for. Pure."""

from __future__ import annotations

from enum import IntEnum

from paani import messages as m
from paani_services.mavlink.snapshot import Snapshot


class Mode(IntEnum):
    """`custom_mode` of a rover: https://ardupilot.org/rover/docs/parameters.html#mode1.

    In ArduRover's HOLD a boat has no thrust and drifts; in LOITER it keeps its station.
    """

    MANUAL = 0
    HOLD = 4
    LOITER = 5
    AUTO = 10
    RTL = 11


DRIVE_MODES = {
    Mode.MANUAL: m.DriveMode.MANUAL,
    Mode.HOLD: m.DriveMode.IDLE,
    Mode.LOITER: m.DriveMode.HOLD,
    Mode.AUTO: m.DriveMode.ROUTE,
    Mode.RTL: m.DriveMode.RETURN,
}
ROVER_MODES = {drive_mode: mode for mode, drive_mode in DRIVE_MODES.items()}


def mode_of(snapshot: Snapshot) -> Mode:
    """The mode that the operator's process says; HOLD while it is silent."""
    return Mode.HOLD if snapshot.operator is None else ROVER_MODES[snapshot.operator.mode]
