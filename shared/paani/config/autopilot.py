"""Settings of an autopilot that drives the motors of a hull, in place of our own microcontroller."""

from __future__ import annotations

from typing import Annotated

import msgspec

from paani.config.section import Section
from paani.port_address import is_loopback, parse_address

AUTOPILOT_FORMATS = "serial:/dev/NAME@BAUD, or socket://127.0.0.1:PORT of a program on this machine"


class AutopilotConfig(Section, frozen=True):
    """ArduPilot Rover, by MAVLink. `line`: its serial port, or a program of this machine; empty: there is none.

    `own_system`: who this process is there; the autopilot obeys the one in its `SYSID_MYGCS` alone, so that a ground
    station at the same autopilot needs another number.
    """

    line: str = ""
    system: Annotated[int, msgspec.Meta(ge=1, le=250)] = 1  # the autopilot's `SYSID_THISMAV`
    own_system: Annotated[int, msgspec.Meta(ge=1, le=255)] = 254

    def __post_init__(self) -> None:
        """The line is one that nobody else can write to, and both ends have numbers of their own."""
        if self.line:
            try:
                device, baud = parse_address(self.line)
            except ValueError as error:
                raise ValueError(f"autopilot.line: {error}") from error
            if not baud and not is_loopback(device.rpartition(":")[0]):
                raise ValueError(
                    f"autopilot.line {self.line}: its frames are not signed (expected {AUTOPILOT_FORMATS})"
                )
        if self.system == self.own_system:
            raise ValueError(f"autopilot.own_system {self.own_system}: is the autopilot's own number")
