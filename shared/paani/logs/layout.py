"""Where things lie in one MCAP file, whole or damaged: channels, attachments, and the spans that hold messages."""

from __future__ import annotations

import io
import mmap
import struct
import zlib
from collections.abc import Container, Iterator
from pathlib import Path
from typing import Any

import msgspec
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, ChunkIndex, Footer, Header, Metadata, Statistics
from mcap.stream_reader import get_chunk_data_stream

from paani.errors import UserError

MAGIC = bytes((137, 77, 67, 65, 80, 48, 13, 10))
PROFILE = "paani"
FOOTER_BYTES = 9 + 20
MAX_CHUNK_BYTES = 1 << 30
MAX_LOOSE_BYTES = 1 << 20
DAMAGE = (McapError, zstandard.ZstdError, struct.error, ValueError, ArithmeticError, MemoryError, RuntimeError)

_HEAD = struct.Struct("<BQ")
_MESSAGE = struct.Struct("<HIQQ")
_CHUNK = struct.Struct("<QQQ")


class Span(msgspec.Struct, frozen=True):
    """Bytes of a file that hold messages: one chunk, or messages outside chunks (`loose`). Times [us] include both."""

    offset: int
    length: int
    start_us: int
    end_us: int
    loose: bool = False


class Layout(msgspec.Struct):
    """One file. `channels` are topics by id; `counts` messages by topic."""

    path: Path
    library: str = ""
    spans: list[Span] = []
    channels: dict[int, str] = {}
    counts: dict[str, int] = {}
    attachments: dict[str, bytes] = {}
    metadata: dict[str, dict[str, str]] = {}
    problems: list[str] = []


def layout_of(path: Path) -> Layout:
    """Find out, from the summary where it is whole, else from the data. Raises UserError for what is no MCAP file."""
    try:
        with path.open("rb") as file:
            size = file.seek(0, io.SEEK_END)
            if size == 0:
                raise UserError(f"{path}: empty file")
            with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
                return _layout(path, data)
    except OSError as error:
        raise UserError(f"{path}: {error.strerror}") from error


def messages_in(data: bytes, wanted: Container[int]) -> Iterator[tuple[int, int, int, bytes]]:
    """(channel id, sequence, log time [ns], payload) of every whole message of the wanted channels, as they lie."""
    at, end = 0, len(data)
    while at + _HEAD.size <= end:
        opcode, length = _HEAD.unpack_from(data, at)
        body = at + _HEAD.size
        at = body + length
        if at > end:
            return
        if opcode == Opcode.MESSAGE and length >= _MESSAGE.size:
            number, sequence, log_ns, _ = _MESSAGE.unpack_from(data, body)
            if number in wanted:
                yield number, sequence, log_ns, data[body + _MESSAGE.size : at]


def span_bytes(path: Path, span: Span) -> tuple[bytes, str]:
    """The records of a span, unpacked, or none of them and what is wrong: a chunk that fails its checksum is not used."""
    try:
        with path.open("rb") as file:
            file.seek(span.offset)
            data = file.read(span.length)
    except OSError as error:
        return b"", str(error.strerror)
    if span.loose:
        return data, ""
    return _unpacked(data, span.offset)


def _unpacked(content: bytes, offset: int) -> tuple[bytes, str]:
    try:
        chunk = Chunk.read(_stream(content))
        if chunk.uncompressed_size > MAX_CHUNK_BYTES:
            return b"", f"chunk at byte {offset} claims {chunk.uncompressed_size} bytes, left out"
        stream, length = get_chunk_data_stream(chunk, validate_crc=True)
        data: bytes = stream.read(length)
    except DAMAGE as error:
        return b"", f"chunk at byte {offset} is damaged, left out ({_line(error)})"
    return data, ""


def _layout(path: Path, data: mmap.mmap) -> Layout:
    if data[: len(MAGIC)] != MAGIC:
        raise UserError(f"{path}: not an MCAP file")
    layout = Layout(path)
    try:
        whole = _read_summary(layout, data)
    except DAMAGE as error:
        layout, whole = Layout(path), False
        layout.problems.append(f"summary is damaged ({_line(error)})")
    if not whole:
        kept = layout.problems
        layout = Layout(path, problems=kept or ["unfinished (`paani logs repair` mends it)"])
        _read_data(layout, data)
    return layout


def _read_summary(layout: Layout, data: mmap.mmap) -> bool:
    """Fill the layout from the summary; false where there is none, or messages lie outside chunks."""
    if len(data) < 2 * len(MAGIC) + FOOTER_BYTES or data[-len(MAGIC) :] != MAGIC:
        return False
    at = len(data) - len(MAGIC) - FOOTER_BYTES
    opcode, length = _HEAD.unpack_from(data, at)
    if opcode != Opcode.FOOTER or length != FOOTER_BYTES - _HEAD.size:
        return False
    footer = Footer.read(_stream(data[at + _HEAD.size : at + FOOTER_BYTES]))
    if not 0 < footer.summary_start < at:
        return False
    if footer.summary_crc and zlib.crc32(data[footer.summary_start : at + FOOTER_BYTES - 4]) != footer.summary_crc:
        layout.problems.append("summary fails its checksum")
        return False
    counts: dict[int, int] = {}
    chunked = 0
    for kind, start, size in _walk(data, footer.summary_start, at):
        stream = _stream(data[start : start + size])
        if kind == Opcode.CHANNEL:
            _learn_channel(layout, stream)
        elif kind == Opcode.STATISTICS:
            statistics = Statistics.read(stream)
            counts, chunked = statistics.channel_message_counts, statistics.message_count
        elif kind == Opcode.CHUNK_INDEX:
            index = ChunkIndex.read(stream)
            if index.chunk_length < _HEAD.size or index.chunk_start_offset + index.chunk_length > at:
                raise ValueError("a chunk lies outside the file")
            layout.spans.append(
                Span(
                    index.chunk_start_offset + _HEAD.size,
                    index.chunk_length - _HEAD.size,
                    index.message_start_time // 1000,
                    index.message_end_time // 1000,
                )
            )
        elif kind in {Opcode.ATTACHMENT_INDEX, Opcode.METADATA_INDEX}:
            _learn_record(layout, data, int.from_bytes(data[start : start + 8], "little"))
    if chunked and not layout.spans:
        return False
    _, start, size = _record_at(data, len(MAGIC))
    _learn_header(layout, data[start : start + size])
    layout.counts = {layout.channels[number]: n for number, n in counts.items() if number in layout.channels}
    return True


def _read_data(layout: Layout, data: mmap.mmap) -> None:
    """Fill the layout by going through the whole file, up to where it ends or makes no sense."""
    loose = at = len(MAGIC)
    try:
        for kind, start, size in _walk(data, len(MAGIC), len(data)):
            if kind not in {Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE} or start - loose > MAX_LOOSE_BYTES:
                _learn_loose(layout, data, loose, start - _HEAD.size)
                loose = start + size
            if kind == Opcode.CHUNK:
                _learn_chunk(layout, data, start, size)
            elif kind == Opcode.HEADER:
                _learn_header(layout, data[start : start + size])
            elif kind in {Opcode.ATTACHMENT, Opcode.METADATA}:
                _learn_record(layout, data, start - _HEAD.size)
            at = start + size
            if kind in {Opcode.DATA_END, Opcode.FOOTER}:
                break
    except DAMAGE as error:
        layout.problems.append(f"nothing can be read after byte {at} of {len(data)} ({_line(error)})")
    _learn_loose(layout, data, loose, at)


def _walk(data: mmap.mmap, at: int, end: int) -> Iterator[tuple[int, int, int]]:
    """(opcode, start, length) of the content of every record. Raises ValueError where a record leaves the range."""
    while at < end:
        if at + _HEAD.size > end:
            if data[at:end] == MAGIC:
                return
            raise ValueError("a record is cut")
        opcode, length = _HEAD.unpack_from(data, at)
        start = at + _HEAD.size
        at = start + length
        if at > end or opcode == 0:
            raise ValueError("a record is cut")
        yield opcode, start, length


def _record_at(data: mmap.mmap, at: int) -> tuple[int, int, int]:
    for record in _walk(data, at, len(data)):
        return record
    raise ValueError("a record lies outside the file")


def _learn_chunk(layout: Layout, data: mmap.mmap, start: int, size: int) -> None:
    content = data[start : start + size]
    start_ns, end_ns, _ = _CHUNK.unpack_from(content)
    unpacked, problem = _unpacked(content, start)
    if problem:
        layout.problems.append(problem)
        return
    layout.spans.append(Span(start, size, start_ns // 1000, end_ns // 1000))
    _learn_messages(layout, unpacked)


def _learn_loose(layout: Layout, data: mmap.mmap, start: int, end: int) -> None:
    """Messages outside chunks."""
    if end <= start:
        return
    content = data[start:end]
    times_us = _learn_messages(layout, content)
    if times_us:
        layout.spans.append(Span(start, end - start, min(times_us), max(times_us), loose=True))


def _learn_messages(layout: Layout, content: bytes) -> list[int]:
    at = 0
    while at + _HEAD.size <= len(content):
        opcode, length = _HEAD.unpack_from(content, at)
        if opcode == Opcode.CHANNEL:
            _learn_channel(layout, _stream(content[at + _HEAD.size : at + _HEAD.size + length]))
        at += _HEAD.size + length
    times_us = []
    for number, _, log_ns, _ in messages_in(content, layout.channels):
        topic = layout.channels[number]
        layout.counts[topic] = layout.counts.get(topic, 0) + 1
        times_us.append(log_ns // 1000)
    return times_us


def _learn_channel(layout: Layout, stream: Any) -> None:
    channel = Channel.read(stream)
    layout.channels[channel.id] = channel.topic


def _learn_header(layout: Layout, content: bytes) -> None:
    header = Header.read(_stream(content))
    layout.library = header.library
    if header.profile != PROFILE:
        layout.problems.append(f"profile '{header.profile[:40]}': not recorded by PAANI")


def _learn_record(layout: Layout, data: mmap.mmap, at: int) -> None:
    """An attachment or a metadata record at a byte of the file; the first of a name wins."""
    opcode, start, length = _record_at(data, at)
    content = data[start : start + length]
    try:
        if opcode == Opcode.METADATA:
            record = Metadata.read(_stream(content))
            layout.metadata.setdefault(record.name, record.metadata)
        elif opcode == Opcode.ATTACHMENT:
            if zlib.crc32(content[:-4]) != int.from_bytes(content[-4:], "little") and any(content[-4:]):
                raise ValueError("fails its checksum")
            attachment = Attachment.read(_stream(content))
            layout.attachments.setdefault(attachment.name, attachment.data)
    except DAMAGE as error:
        layout.problems.append(f"record at byte {at} is damaged, left out ({_line(error)})")


def _stream(content: bytes) -> Any:
    return ReadDataStream(io.BytesIO(content))


def _line(error: BaseException) -> str:
    return (str(error) or type(error).__name__).splitlines()[0][:120]
