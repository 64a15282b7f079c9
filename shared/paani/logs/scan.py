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
from mcap.stream_reader import get_chunk_data_stream

from paani.logs.layout import DAMAGE, MAGIC, MAX_CHUNK_BYTES, MESSAGE

HEAD = struct.Struct("<BQ")
# In a chunk: opcode and length, two times, size, checksum, then the name of the compression.
ZSTD_MARK, MARK_AT = b"\x04\x00\x00\x00zstd", HEAD.size + 28
OPCODES = frozenset(opcode.value for opcode in Opcode)
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

    A chunk or attachment can be read when its checksum is right. Nothing is raised, whatever the bytes.
    """
    end = len(data)
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
        resumed = _resume(data, at, record)
        yield Damage(at, resumed, cause)
        at = resumed


def content(data: Data, record: ScannedRecord) -> bytes:
    """The bytes of a record after its head."""
    return bytes(data[record.start + HEAD.size : record.end])


def unpacked(data: Data, chunk: ScannedRecord) -> bytes:
    """The records in a chunk that `scan` has found."""
    stream, length = get_chunk_data_stream(Chunk.read(stream_of(content(data, chunk))), validate_crc=False)
    inside: bytes = stream.read(length)
    return inside


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
                chunk = Chunk.read(stream)
                if chunk.uncompressed_size > MAX_CHUNK_BYTES:
                    return f"a chunk of {chunk.uncompressed_size} bytes"
                unpacked_stream, length = get_chunk_data_stream(chunk, validate_crc=True)
                return _fault_inside(unpacked_stream.read(length))
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
        return (str(error) or type(error).__name__).splitlines()[0][:80]
    return "" if record.opcode == Opcode.ATTACHMENT or stream.count == len(inside) else "a record of the wrong length"


def _fault_inside(records: bytes) -> str:
    """What is wrong with the first record of a chunk that cannot be read: a chunk need not have a checksum."""
    faults = (_fault(records, each) for each in records_in(records) if each.opcode in INSIDE_CHUNKS)
    return next(filter(None, faults), "")


def _resume(data: Data, at: int, damaged: ScannedRecord) -> int:
    """Where reading can go on: after the damaged record, if its length is right, else at the next whole chunk."""
    if at < damaged.end < len(data) and not _record(data, damaged.end)[1]:
        return damaged.end
    mark = at + MARK_AT + 1
    while (mark := data.find(ZSTD_MARK, mark)) >= 0:
        start = mark - MARK_AT
        if data[start] == Opcode.CHUNK and not _record(data, start)[1]:
            return start
        mark += 1
    return len(data)
