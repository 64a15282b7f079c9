"""Settings of the NMEA 0183 port."""

from __future__ import annotations

from typing import Annotated

import msgspec

from paani.config.section import Section
from paani.port_address import tcp_address


class NmeaConfig(Section, frozen=True):
    """`listen`: where plotters connect by TCP, HOST:PORT. Whoever reaches it may read, and writes nothing."""

    listen: str = "127.0.0.1:10110"  # IANA: nmea-0183
    rate_hz: Annotated[float, msgspec.Meta(ge=0.2, le=10.0)] = 2.0  # 300 bytes each time, and 60 for each target
    max_clients: Annotated[int, msgspec.Meta(ge=1, le=64)] = 8  # one more is let go at once

    def __post_init__(self) -> None:
        """The address can be parsed."""
        tcp_address(self.listen)
