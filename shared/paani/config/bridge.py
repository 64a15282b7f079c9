"""Settings of the bridge to the microcontroller that shows the advice."""

from __future__ import annotations

from typing import Annotated

import msgspec

from paani.config.section import Section
from paani.port_address import require_line


class BridgeConfig(Section, frozen=True):
    """`line` is the way to the microcontroller: `serial:/dev/NAME@BAUD`, `socket://HOST:PORT`, or `unix:/PATH` of the
    board's router. Empty: nothing is shown, and no bridge runs.
    """

    line: str = ""
    # Frames a second; a change of advice goes out at once. At fewer, one lost answer ends a lease; at more, frames pile
    # up in the board's router, which keeps no order.
    rate_hz: Annotated[float, msgspec.Meta(ge=5.0, le=10.0)] = 10.0
    # How long advice is shown after its picture: 0.6 s, after which the advisor gives it up, and 0.1 s for the way.
    lease_ms: Annotated[int, msgspec.Meta(ge=500, le=4000)] = 700

    def __post_init__(self) -> None:
        """The line can be parsed."""
        if self.line:
            require_line(self.line)
