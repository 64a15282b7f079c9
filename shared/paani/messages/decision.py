"""How a decision came about: what a deciding process had heard, and what it sent."""

from __future__ import annotations

from typing import Annotated

import msgspec

from paani.messages.header import Count, Message, Stamp, Text

State = Annotated[str, msgspec.Meta(max_length=1_000_000)]


class InputMessage(msgspec.Struct, frozen=True, kw_only=True):
    """One message that a step was given, and when it came.

    `source_us`: its stamp as the step was given it, by this machine's clock, where board and host are two; else 0.
    """

    topic: Text
    epoch: Count
    seq: Count
    received_us: Stamp
    source_us: Stamp = 0


class OutputMessage(msgspec.Struct, frozen=True, kw_only=True):
    """One message that a step sent, with what the bus put into its header."""

    topic: Text
    epoch: Count
    seq: Count
    sent_us: Stamp
    steady_us: Stamp = 0


class Step(Message, frozen=True, kw_only=True):
    """One call of a decider; `source_us` is the time it was given.

    `state`: the decider's state before the call as JSON; empty but for the first step and one every two seconds,
    from which the following steps can be computed again.
    """

    heard: tuple[InputMessage, ...] = ()
    sent: tuple[OutputMessage, ...] = ()
    state: State = ""
