"""The page of topics, from the table of keys."""

from __future__ import annotations

from typing import Any

from docs.reference.markdown import table
from paani import keys

INTRODUCTION = """# Topics

Everything that crosses the bus, below `paani/<domain>/<vessel>/` (`bus.domain`, `bus.vessel`). The router lets nobody
but the process in the third column write a topic, so the table is also the list of who may do what; see
[authority](../concepts/authority.md).

*Rate* is nominal. *Fresh* is how old the newest message may be before the topic counts as stale. A *state* is
republished and the newest wins; an *event* keeps a short queue; a *command* is newest-wins and urgent; a *picture* is
encoded bytes with a header attached. Below `@truth` lies what only a simulator knows: no wildcard matches it, and no
process that decides may read it.

`paani topics` prints the table, with measured rates where a boat is running; `paani echo TOPIC` prints messages and
`paani hz TOPIC` counts them.

"""


def topics_page() -> str:
    """All topics, heartbeats and health reports included."""
    header = ("topic", "message", "written by", "rate [Hz]", "fresh [s]", "travels as", "what it is")
    return INTRODUCTION + table(header, (_row(topic) for topic in keys.every_topic()))


def _row(topic: keys.Topic[Any]) -> tuple[str, ...]:
    kind = topic.type.__name__
    return (
        f"`{topic.name}`",
        f"[{kind}](messages.md#{kind.lower()})",
        keys.producers_text(topic),
        f"{topic.rate_hz:g}",
        f"{topic.fresh_s:g}",
        str(topic.stance),
        topic.summary,
    )
