"""What differs between two payloads of one message, and between two decisions in words. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import msgspec

from paani import messages as m
from paani.undecodable import UNDECODABLE

ABSENT = "(absent)"
Schema = Mapping[str, Any]


class Difference(msgspec.Struct, frozen=True, kw_only=True):
    """The first field that differs. `at_us` is the time the step was given."""

    at_us: int
    topic: str
    epoch: int
    seq: int
    field: str
    recorded: str
    computed: str


def first_difference(at_us: int, sent: m.OutputMessage, recorded: bytes, computed: bytes) -> Difference:
    """Name the first differing field of two payloads that are not the same bytes."""
    field, before, now = next(
        differing_fields(recorded, computed), ("(bytes)", f"{len(recorded)} bytes", f"{len(computed)} bytes")
    )
    return Difference(
        at_us=at_us,
        topic=sent.topic,
        epoch=sent.epoch,
        seq=sent.seq,
        field=field,
        recorded=_short(before),
        computed=_short(now),
    )


def as_recorded(computed: bytes, recorded: bytes | None, schema: Schema | None = None) -> bytes:
    """The computed payload without the fields that the version which recorded did not have.

    schema: of the recorded messages (`paani.logs.schema`). What it knows and the message lacks was not set, which is a
    value of its own. Without one an absent field is taken for an added one, as structures only ever gain fields.
    """
    if recorded is None or computed == recorded:
        return computed
    try:
        before, now = msgspec.json.decode(recorded), msgspec.json.decode(computed)
    except UNDECODABLE:
        return computed
    return msgspec.json.encode(_without_added(before, now, schema))


def _without_added(before: Any, now: Any, schema: Schema | None) -> Any:
    if isinstance(before, dict) and isinstance(now, dict):
        known = _part(schema, "properties")
        return {
            name: _without_added(before[name], value, _part(known, name)) if name in before else value
            for name, value in now.items()
            if name in before or name in (known or ())
        }
    if isinstance(before, list) and isinstance(now, list) and len(before) == len(now):
        item = _part(schema, "items")
        return [_without_added(one, other, item) for one, other in zip(before, now, strict=True)]
    return now


def _part(schema: Schema | None, name: str) -> Schema | None:
    part = None if schema is None else schema.get(name)
    return part if isinstance(part, dict) else None


def differing_fields(recorded: bytes, computed: bytes) -> Iterator[tuple[str, Any, Any]]:
    """(path, recorded value, computed value) of every leaf that differs; nothing where either is not JSON."""
    try:
        trees = msgspec.json.decode(recorded), msgspec.json.decode(computed)
    except UNDECODABLE:
        return
    yield from _leaves("", *trees)


def _leaves(path: str, before: Any, now: Any) -> Iterator[tuple[str, Any, Any]]:
    if isinstance(before, dict) and isinstance(now, dict):
        for name in dict.fromkeys((*before, *now)):
            yield from _leaves(f"{path}.{name}".lstrip("."), before.get(name, ABSENT), now.get(name, ABSENT))
    elif isinstance(before, list) and isinstance(now, list) and len(before) == len(now):
        for number, (one, other) in enumerate(zip(before, now, strict=True)):
            yield from _leaves(f"{path}[{number}]", one, other)
    elif type(before) is not type(now) or before != now:
        yield path or "(message)", before, now


def _short(value: Any) -> str:
    text = value if isinstance(value, str) else msgspec.json.encode(value).decode()
    return text if len(text) <= 80 else text[:77] + "..."
