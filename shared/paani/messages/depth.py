"""What an echo sounder says."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import msgspec

from paani.messages.header import Message

MAX_DEPTH_M = 12_000.0  # no water is deeper


class Depth(Message, frozen=True, kw_only=True):
    """One sounding: depth of the water below its surface, straight under the boat. 0 where no echo came back."""

    depth_m: Annotated[float, msgspec.Meta(ge=0.0, le=MAX_DEPTH_M)] = 0.0
    available: bool = True


class SoundingStatus(StrEnum):
    """What the navigator makes of the soundings. It counts new ones while they are OK; what is marked stays marked.

    OFF: none came so far. NO_ECHO: the newest has none. FROZEN: one depth again and again while the boat moves.
    JUMPED: the depth changes faster than a bottom rises. IMPLAUSIBLE: a depth that no water has. STALE: none comes any
    more.
    """

    OFF = "off"
    OK = "ok"
    NO_ECHO = "no_echo"
    FROZEN = "frozen"
    JUMPED = "jumped"
    IMPLAUSIBLE = "implausible"
    STALE = "stale"
