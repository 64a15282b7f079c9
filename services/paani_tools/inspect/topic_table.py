"""The table of keys as text."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from typing import Any

from paani import keys
from paani.errors import UserError

HEAD = ("topic", "type", "producer", "rate [Hz]", "fresh [s]", "travels as", "what it is")


def topic_rows() -> list[tuple[str, ...]]:
    """One row of text for each topic, in the order of the table."""
    return [
        (t.name, t.type.__name__, keys.producers_text(t), f"{t.rate_hz:g}", f"{t.fresh_s:g}", t.stance.value, t.summary)
        for t in keys.TOPICS
    ]


def topics_markdown() -> str:
    """The table in Markdown, as the contract's README shows it."""
    lines = ["| " + " | ".join(HEAD) + " |", "|" + "---|" * len(HEAD)]
    lines += ["| `" + row[0] + "` | " + " | ".join(row[1:]) + " |" for row in topic_rows()]
    return "\n".join(lines) + "\n"


def topics_text(live_hz: Mapping[str, float] | None) -> str:
    """The table in columns, with the rates measured now when there is a bus."""
    head: tuple[str, ...] = HEAD
    body = topic_rows()
    if live_hz is not None:
        head = (*HEAD[:4], "now [Hz]", *HEAD[4:])
        body = [(*row[:4], f"{live_hz[row[0]]:.1f}", *row[4:]) for row in body]
    widths = [max(len(row[column]) for row in (head, *body)) for column in range(len(head))]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) for row in (head, *body)]
    return "".join(line.rstrip() + "\n" for line in lines)


def topic_named(name: str) -> keys.Topic[Any]:
    """The topic of that name, pulses and health reports included. Raises UserError with the nearest names."""
    known: dict[str, keys.Topic[Any]] = {topic.name: topic for topic in keys.TOPICS}
    for service in keys.SERVICES:
        known |= {topic.name: topic for topic in (keys.pulse(service), keys.health(service))}
    if name in known:
        return known[name]
    near = difflib.get_close_matches(name, known, n=3, cutoff=0.4)
    raise UserError(f"unknown topic '{name}' ({'like ' + ', '.join(near) if near else 'see `paani topics`'})")
