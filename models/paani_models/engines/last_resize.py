"""Drop a last node that only resizes the output. Works on the file's bytes, as the board has no onnx package.

A protocol buffer is a sequence of fields, each preceded by its number; the numbers here are those of onnx.proto.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

_GRAPH = 7  # of a model
_NODE, _OUTPUT = 1, 12  # of a graph
_INPUT_NAME, _OUTPUT_NAME, _OP_TYPE, _ATTRIBUTE = 1, 2, 4, 5  # of a node
_NAME, _TEXT = 1, 4  # of an attribute; a value begins with its name as well
_FLOAT32 = b"\x12\x04\x0a\x02\x08\x01"  # a value's type: a tensor of float32, its shape for the reader to infer
_MAX_VARINT_BITS = 70  # ten groups hold any number of 64 bits
_VARINT, _EIGHT_BYTES, _LENGTH_FIRST, _FOUR_BYTES = 0, 1, 2, 5


class _Field(NamedTuple):
    number: int
    whole: memoryview
    content: memoryview


def drop_last_resize(model: bytes) -> bytes | None:
    """The network that answers what its last step would have resized; None where the last step is no such resize.

    A nearest or linear resize qualifies, as it leaves the cells' centres in place; one that aligns corners does not.
    None also for bytes that are no ONNX model.
    """
    try:
        return _drop_last_resize(model)
    except ValueError:
        return None


def _drop_last_resize(model: bytes) -> bytes | None:
    outer = list(_read_fields(memoryview(model)))
    graph = [field for part in outer if part.number == _GRAPH for field in _read_fields(part.content)]
    answers = [_first_content(field.content, _NAME) for field in graph if field.number == _OUTPUT]
    last = next((f for f in graph if f.number == _NODE and _first_content(f.content, _OUTPUT_NAME) in answers), None)
    if len(answers) != 1 or last is None or not _is_plain_resize(last.content):
        return None
    answer = _encode_field(_NAME, _first_content(last.content, _INPUT_NAME)) + _FLOAT32
    kept_fields = [field.whole for field in graph if field is not last and field.number != _OUTPUT]
    rest = [part.whole for part in outer if part.number != _GRAPH]
    return b"".join((*rest, _encode_field(_GRAPH, b"".join((*kept_fields, _encode_field(_OUTPUT, answer))))))


def _is_plain_resize(node: memoryview) -> bool:
    if _first_content(node, _OP_TYPE) != b"Resize":
        return False
    settings = {
        _first_content(field.content, _NAME): _first_content(field.content, _TEXT)
        for field in _read_fields(node)
        if field.number == _ATTRIBUTE
    }
    moved = settings.get(b"coordinate_transformation_mode") in {b"align_corners", b"tf_crop_and_resize"}
    return settings.get(b"mode", b"nearest") in {b"nearest", b"linear"} and not moved


def _first_content(message: memoryview, number: int) -> bytes:
    """The content of the first field of that number; empty where there is none."""
    return next((bytes(field.content) for field in _read_fields(message) if field.number == number), b"")


def _read_fields(message: memoryview) -> Iterator[_Field]:
    end = 0
    while end < len(message):
        start = end
        key, begin = _read_varint(message, start)
        kind = key & 7
        if kind == _VARINT:
            _, end = _read_varint(message, begin)
        elif kind == _LENGTH_FIRST:
            size, begin = _read_varint(message, begin)
            end = begin + size
        elif kind in {_EIGHT_BYTES, _FOUR_BYTES}:
            end = begin + (8 if kind == _EIGHT_BYTES else 4)
        else:
            raise ValueError(f"a field of kind {kind}")
        if end > len(message):
            raise ValueError("ends within a field")
        yield _Field(key >> 3, message[start:end], message[begin:end])


def _read_varint(message: memoryview, at: int) -> tuple[int, int]:
    """A number in groups of seven bits, lowest first, and where it ends."""
    value = shift = 0
    while at < len(message) and shift < _MAX_VARINT_BITS:
        value |= (message[at] & 0x7F) << shift
        shift, at = shift + 7, at + 1
        if message[at - 1] < 0x80:
            return value, at
    raise ValueError("ends within a number")


def _encode_field(number: int, content: bytes) -> bytes:
    return _encode_varint(number << 3 | _LENGTH_FIRST) + _encode_varint(len(content)) + content


def _encode_varint(value: int) -> bytes:
    groups = []
    while value > 0x7F:
        groups.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*groups, value])
