"""Goes through the records of an MCAP file, whole or damaged, and finds its way again after damage. Pure."""

from __future__ import annotations

import io
import mmap
import struct
import zlib
from collections.abc import Iterator
from typing import NamedTuple

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Header, Metadata, Schema

from paani.logs.layout import DAMAGE, MAGIC, MESSAGE, line_of, unpacked_records

HEAD = struct.Struct("<BQ")
# In a chunk: opcode and length, two times, size, checksum, then the name of the compression.
ZSTD_MARK, MARK_AT = b"\x04\x00\x00\x00zstd", HEAD.size + 28
OPCODES = frozenset(opcode.value for opcode in Opcode)
MAX_TIMES_IN_VAIN = 16
INSIDE_CHUNKS = frozenset({Opcode.SCHEMA.value, Opcode.CHANNEL.value, Opcode.MESSAGE.value})

Data = bytes | mmap.mmap


class ScannedRecord(NamedTuple):
    """A record that can be read: its opcode, and where it lies, its head included."""

    opcode: int
    start: int
    end: int


class Damage(NamedTuple):
    """Bytes that cannot be read."""

    start: int
    end: int
    cause: str


def scan(data: Data) -> Iterator[ScannedRecord | Damage]:
    """Every record in order, of data and summary alike. What lies between two that can be read is damage.

    A chunk or attachment can be read when its checksum is right. Nothing is raised, whatever the bytes. Work grows as
    the file does: where more than MAX_TIMES_IN_VAIN times its bytes were read in vain, the rest is damage.
    """
    end = len(data)
    in_vain = 0  # bytes of records that could not be read: those of a hostile file overlap
    at = len(MAGIC)
    if data[:at] != MAGIC:
        at = 0
    while at < end:
        if end - at == len(MAGIC) and data[at:end] == MAGIC:
            return
        record, cause = _record(data, at)
        if not cause:
            yield record
            at = record.end
            continue
        in_vain += _size_in(data, record)
        resumed = end
        for place in _places_to_resume(data, at, record):
            if in_vain > MAX_TIMES_IN_VAIN * end:
                break
            candidate, fault = _record(data, place)
            if not fault:
                resumed = place
                break
            in_vain += _size_in(data, candidate)
        yield Damage(at, resumed, cause)
        at = resumed


def content(data: Data, record: ScannedRecord) -> bytes:
    """The bytes of a record after its head."""
    return bytes(data[record.start + HEAD.size : record.end])


def unpacked(data: Data, chunk: ScannedRecord) -> bytes:
    """The records in a chunk that `scan` has found."""
    return unpacked_records(Chunk.read(stream_of(content(data, chunk))))


def records_in(inside: bytes) -> Iterator[ScannedRecord]:
    """The whole records in an unpacked chunk."""
    at = 0
    while at + HEAD.size <= len(inside):
        opcode, length = HEAD.unpack_from(inside, at)
        end = at + HEAD.size + length
        if end > len(inside):
            return
        yield ScannedRecord(opcode, at, end)
        at = end


def stream_of(data: bytes) -> ReadDataStream:
    return ReadDataStream(io.BytesIO(data))


def _record(data: Data, at: int) -> tuple[ScannedRecord, str]:
    """The record at a place, and why it cannot be read."""
    if at + HEAD.size > len(data):
        return ScannedRecord(0, at, len(data)), "cut"
    opcode, length = HEAD.unpack_from(data, at)
    record = ScannedRecord(opcode, at, at + HEAD.size + length)
    if opcode not in OPCODES:
        return record, "not a record"
    if record.end > len(data):
        return record, "cut"
    return record, _fault(data, record)


def _fault(data: Data, record: ScannedRecord) -> str:
    inside = content(data, record)
    stream = stream_of(inside)
    try:
        match record.opcode:
            case Opcode.CHUNK:
                return _fault_inside(unpacked_records(Chunk.read(stream)))
            case Opcode.ATTACHMENT:
                Attachment.read(stream)
                if any(inside[-4:]) and zlib.crc32(inside[:-4]) != int.from_bytes(inside[-4:], "little"):
                    return "an attachment fails its checksum"
            case Opcode.HEADER:
                Header.read(stream)
            case Opcode.SCHEMA:
                Schema.read(stream)
            case Opcode.CHANNEL:
                Channel.read(stream)
            case Opcode.METADATA:
                Metadata.read(stream)
            case Opcode.MESSAGE if len(inside) < MESSAGE.size:
                return f"a message of {len(inside)} bytes"
            case _:
                return ""
    except DAMAGE as error:
        return line_of(error)
    return "" if record.opcode == Opcode.ATTACHMENT or stream.count == len(inside) else "a record of the wrong length"


def _fault_inside(records: bytes) -> str:
    """What is wrong with the first record of a chunk that cannot be read: a chunk need not have a checksum."""
    for each in records_in(records):
        if each.opcode not in INSIDE_CHUNKS:
            return f"a record of opcode {each.opcode} in a chunk"
        if fault := _fault(records, each):
            return fault
    return ""


def _places_to_resume(data: Data, at: int, damaged: ScannedRecord) -> Iterator[int]:
    """Where reading may go on: after the damaged record, if its length is right, else at a later chunk."""
    if at < damaged.end < len(data):
        yield damaged.end
    mark = at + MARK_AT
    while (mark := data.find(ZSTD_MARK, mark + 1)) >= 0:
        if data[mark - MARK_AT] == Opcode.CHUNK:
            yield mark - MARK_AT


def _size_in(data: Data, record: ScannedRecord) -> int:
    """Bytes that were read to find that a record is damaged; of one that ends outside none but its head were."""
    return record.end - record.start if record.end <= len(data) else HEAD.size
