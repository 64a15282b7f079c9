"""The header that every message carries, and the bounded types that fields are made of."""

from __future__ import annotations

from typing import Annotated

import msgspec

Unit = Annotated[float, msgspec.Meta(ge=0.0, le=1.0)]
Signed = Annotated[float, msgspec.Meta(ge=-1.0, le=1.0)]
Finite = Annotated[float, msgspec.Meta(ge=-1e9, le=1e9)]
NonNegative = Annotated[float, msgspec.Meta(ge=0.0, le=1e9)]
Count = Annotated[int, msgspec.Meta(ge=0, le=2**53)]
Stamp = Annotated[int, msgspec.Meta(ge=0, le=2**53)]
Text = Annotated[str, msgspec.Meta(max_length=400)]
BoxXyxy = tuple[Unit, Unit, Unit, Unit]


class Message(msgspec.Struct, frozen=True, kw_only=True):
    """Common header. `source_us` dates the evidence, not this message; a republish keeps it.

    The bus fills the rest when it publishes: `seq` counts this producer's messages on the key, `epoch`
    changes when the producer restarts or its source begins again, `sent_us` is when it left. Where board and host are
    two machines, `steady_us` is that too, by a clock of the producer's machine that is never set; else it is 0. `topic`
    is the name of the topic it was published on: whoever gets it by another key refuses it.
    """

    source_us: Stamp
    seq: Count = 0
    epoch: Count = 0
    domain: Count = 43
    producer: Text = ""
    sent_us: Stamp = 0
    steady_us: Stamp = 0
    topic: Text = ""
