"""The page of messages, from their types."""

from __future__ import annotations

from collections.abc import Iterator
from enum import Enum
from typing import Any

import msgspec
from msgspec import inspect as types

from docs.reference.markdown import prose, table, with_statement_links
from docs.reference.statements import what_statements_say
from paani import keys
from paani import messages as m
from paani.config.value_types import kind_of, range_of, text_of, unit_of

INTRODUCTION = """# Messages

A message is plain JSON (Zenoh encoding `application/json;paani.<Type>`) with every field below and no other. A value
out of its range is refused by whoever hears it, and counted. Angles are radians counter-clockwise from east, boxes
are `(x1, y1, x2, y2)` as fractions of the picture from its top left, stamps (`_us`) are integer microseconds since
1970. A field may be added with a default, so older recordings are still read. Pictures are JPEG or PNG; their
`PictureHeader` travels beside them.

"""


def message_types() -> list[type[msgspec.Struct]]:
    """The types of all topics, and after them the types that they hold, each once."""
    found: dict[type[msgspec.Struct], None] = dict.fromkeys(topic.type for topic in keys.every_topic())
    for kind in list(found):
        found.update(dict.fromkeys(inner for inner in _held_by(_struct(kind)) if issubclass(inner, msgspec.Struct)))
    return list(found)


def enum_types() -> list[type[Enum]]:
    """The closed vocabularies that messages use."""
    held = (inner for kind in message_types() for inner in _held_by(_struct(kind)))
    return list(dict.fromkeys(inner for inner in held if issubclass(inner, Enum)))


def messages_page() -> str:
    """Every message, what it is made of, and what its words may be."""
    known = what_statements_say()
    parts = [INTRODUCTION, _header()]
    for kind in message_types():
        parts.append(
            f"## {kind.__name__}\n\n{with_statement_links(_says(kind), known)}\n\n{_where(kind)}{_fields(kind)}\n"
        )
    for words in enum_types():
        parts.append(f"## {words.__name__}\n\n{with_statement_links(_says(words), known)}\n\n")
        parts.append(", ".join(f"`{member.value}`" for member in words) + "\n\n")
    return "".join(parts)


def _says(kind: type) -> str:
    """The type's own docstring; msgspec and enum give those without one a signature or a stock text."""
    return prose(kind.__dict__.get("__doc__")) if kind.__dict__.get("__doc__") else ""


def _header() -> str:
    return (
        "## Message\n\nThe header: every message of a topic begins with these fields. "
        + prose(m.Message.__doc__)
        + "\n\n"
        + _rows(_struct(m.Message).fields)
        + "\n"
    )


def _where(kind: type[msgspec.Struct]) -> str:
    topics = [f"`{topic.name}`" for topic in keys.TOPICS if topic.type is kind]
    heads = "After the [header](#message)" if issubclass(kind, m.Message) else ""
    return f"Topic: {', '.join(topics)}. {heads}:\n\n" if topics else f"{heads}:\n\n" if heads else ""


def _fields(kind: type[msgspec.Struct]) -> str:
    header = {field.name for field in _struct(m.Message).fields} if issubclass(kind, m.Message) else set()
    fields = tuple(field for field in _struct(kind).fields if field.name not in header)
    return _rows(fields) if fields else "No fields of its own.\n"


def _rows(fields: tuple[types.Field, ...]) -> str:
    header = ("field", "unit", "kind", "range", "default")
    return table(
        header, ((f"`{f.name}`", unit_of(f.name), _linked(f.type), range_of(f.type), _default(f)) for f in fields)
    )


def _default(field: types.Field) -> str:
    if field.required:
        return "required"
    if field.default is msgspec.NODEFAULT and field.default_factory is msgspec.NODEFAULT:
        return "unset"
    value = field.default if field.default is not msgspec.NODEFAULT else field.default_factory()
    return "as the type says" if isinstance(value, msgspec.Struct) else f"`{text_of(value)}`"


def _linked(info: types.Type) -> str:
    """The kind, with a link where it is a type of ours."""
    words = kind_of(info)
    for inner in _inner(info):
        words = words.replace(inner.__name__, f"[{inner.__name__}](#{inner.__name__.lower()})")
    return words


def _held_by(info: types.StructType) -> Iterator[type[Any]]:
    for field in info.fields:
        for inner in _inner(field.type):
            yield inner
            if issubclass(inner, msgspec.Struct):
                yield from _held_by(_struct(inner))


def _inner(info: types.Type) -> Iterator[type[Any]]:
    match info:
        case types.StructType() | types.EnumType():
            yield info.cls
        case types.VarTupleType():
            yield from _inner(info.item_type)
        case types.TupleType():
            yield from _inner(info.item_types[0])


def _struct(kind: type[msgspec.Struct]) -> types.StructType:
    info = types.type_info(kind)
    assert isinstance(info, types.StructType)
    return info
