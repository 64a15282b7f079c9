"""Recorded pictures: encoded bytes out of `foxglove.CompressedImage`, joined to the header that travelled with them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

from paani.logs.reader import Record

HEADER = "/header"
DATA_FIELD = 2


class RecordedPicture(NamedTuple):
    """One picture: the JSON of its header, and its JPEG or PNG bytes."""

    topic: str
    log_us: int
    header: bytes
    data: bytes


def paired_pictures(records: Iterable[Record], topics: Iterable[str]) -> Iterator[Record | RecordedPicture]:
    """Records in their order, where picture and header of the given topics become one; a half alone is left out."""
    waiting: dict[str, Record] = {}
    wanted = frozenset(topics)
    for record in records:
        topic = record.topic.removesuffix(HEADER)
        if topic not in wanted:
            yield record
            continue
        other = waiting.pop(topic, None)
        if other is None or other.topic == record.topic or (other.seq, other.log_us) != (record.seq, record.log_us):
            waiting[topic] = record
            continue
        header, picture = (other, record) if other.topic.endswith(HEADER) else (record, other)
        data = image_bytes(picture.data)
        if data:
            yield RecordedPicture(topic, record.log_us, header.data, data)


def image_bytes(message: bytes) -> bytes:
    """The picture in a `foxglove.CompressedImage`; empty where the message is damaged."""
    at, found = 0, b""
    try:
        while at < len(message):
            key, at = _varint(message, at)
            match key & 7:
                case 0:
                    _, at = _varint(message, at)
                case 1:
                    at += 8
                case 2:
                    size, at = _varint(message, at)
                    if key >> 3 == DATA_FIELD:
                        found = message[at : at + size]
                    at += size
                case 5:
                    at += 4
                case _:
                    return b""
    except IndexError:
        return b""
    return found if at == len(message) else b""


def _varint(data: bytes, at: int) -> tuple[int, int]:
    """A number of at most 64 bits and the place after it. Raises IndexError."""
    value = shift = 0
    while True:
        byte = data[at]
        at += 1
        value |= (byte & 0x7F) << shift
        shift += 7
        if byte < 0x80:
            return value, at
        if shift > 63:
            raise IndexError
