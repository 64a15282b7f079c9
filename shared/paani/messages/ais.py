"""What vessels with an AIS transponder say of themselves (ITU-R M.1371)."""

from __future__ import annotations

from typing import Annotated

import msgspec

from paani.messages.header import Finite, Message, Stamp

MAX_VESSELS = 64  # told at once, nearest in time first: the traffic of a harbour
MAX_SPEED_MPS = 52.6  # 102.2 knots, the highest that a position report can say

Mmsi = Annotated[int, msgspec.Meta(ge=0, le=999_999_999)]
Metres = Annotated[float, msgspec.Meta(ge=0.0, le=1023.0)]


class AisVessel(msgspec.Struct, frozen=True, kw_only=True):
    """A vessel under way by its newest position report; `fixed_us` is when that was received.

    The position is that of its receiver; `to_*_m` say how far the hull reaches from there, 0 where that is not known.
    `cog_rad`: course over ground, counter-clockwise from east.
    """

    mmsi: Mmsi
    fixed_us: Stamp
    latitude_deg: Annotated[float, msgspec.Meta(ge=-90.0, le=90.0)]
    longitude_deg: Annotated[float, msgspec.Meta(ge=-180.0, le=180.0)]
    sog_mps: Annotated[float, msgspec.Meta(ge=0.0, le=MAX_SPEED_MPS)]
    cog_rad: Finite
    to_bow_m: Metres = 0.0
    to_stern_m: Metres = 0.0
    to_port_m: Metres = 0.0
    to_starboard_m: Metres = 0.0


class AisVessels(Message, frozen=True, kw_only=True):
    """Every vessel that was heard lately; empty where there is none. Without a receiver nothing is published."""

    vessels: Annotated[tuple[AisVessel, ...], msgspec.Meta(max_length=MAX_VESSELS)] = ()
