"""JSON schemas of messages, flat enough for the viewers' parsers. Pure.

Foxglove and Lichtblick know `type`, `properties`, `items` and `title`: no `$ref`, no `anyOf`, no bare `enum`, no array
of arrays. What cannot be said in these words is refused, so no message can hold it.
"""

from __future__ import annotations

from typing import Any

import msgspec
from msgspec import inspect


def json_schema(message: type[msgspec.Struct]) -> bytes:
    """The schema of one message type. Raises TypeError naming the field that is open, recursive or nested."""
    return msgspec.json.encode(_schema(inspect.type_info(message), message.__name__, ()))


def _schema(info: inspect.Type, path: str, within: tuple[type, ...]) -> dict[str, Any]:
    match info:
        case inspect.StructType(cls=cls, fields=fields):
            if cls in within:
                raise TypeError(f"{path}: {cls.__name__} holds itself")
            return {
                "type": "object",
                "title": cls.__name__,
                "properties": {
                    field.encode_name: _schema(field.type, f"{path}.{field.name}", (*within, cls)) for field in fields
                },
                "required": [field.encode_name for field in fields if field.required],
            }
        case inspect.UnionType(types=types):
            inner = [kind for kind in types if not isinstance(kind, inspect.NoneType)]
            if len(inner) != 1:
                raise TypeError(f"{path}: one of several types")
            return _schema(inner[0], path, within)
        case inspect.VarTupleType(item_type=item):
            return _array(item, path, within)
        case inspect.TupleType(item_types=items):
            if not items or any(item != items[0] for item in items):
                raise TypeError(f"{path}: a tuple of different types")
            return {**_array(items[0], path, within), "minItems": len(items), "maxItems": len(items)}
        case inspect.BoolType():
            return {"type": "boolean"}
        case inspect.IntType():
            return {"type": "integer"}
        case inspect.FloatType():
            return {"type": "number"}
        case inspect.StrType():
            return {"type": "string"}
        case inspect.BytesType():
            return {"type": "string", "contentEncoding": "base64"}
        case inspect.EnumType(cls=kinds):
            return _words([kind.value for kind in kinds], path)
        case inspect.LiteralType(values=values):
            return _words(list(values), path)
    raise TypeError(f"{path}: {type(info).__name__} is open or unknown")


def _array(item: inspect.Type, path: str, within: tuple[type, ...]) -> dict[str, Any]:
    items = _schema(item, f"{path}[]", within)
    if items["type"] == "array":
        raise TypeError(f"{path}: an array of arrays")
    return {"type": "array", "items": items}


def _words(values: list[Any], path: str) -> dict[str, Any]:
    if not all(isinstance(value, str) for value in values):
        raise TypeError(f"{path}: a choice of other things than words")
    return {"type": "string", "enum": values}
